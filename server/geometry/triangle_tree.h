// An eight-wide tree of boxes over a mesh's triangles: finds every triangle whose box, grown by a radius,
// meets a line. It errs only towards too many, so what is tested exactly afterwards does not depend on it. It
// serves swept spheres of any radius and the few lines that single precision cannot decide. About ten bytes a
// triangle.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "server/geometry/lanes.h"
#include "server/geometry/mesh.h"

namespace touchstone {

class TriangleTree {
 public:
  // The result hangs on the mesh alone; `threads` shortens the wait.
  TriangleTree(const TriangleMesh& mesh, int threads);

  // Calls visit(ids, count, &last_m) with groups of at most eight triangles whose boxes, grown by grow_m on
  // every side, meet the points origin + t * direction with first_m <= t <= last_m; roughly nearest first.
  // visit may lower last_m. grow_m must cover the rounding of coordinates to single precision.
  template <typename Visit>
  void VisitAlong(const Eigen::Vector3d& origin_m, const Eigen::Vector3d& direction, double grow_m,
                  double first_m, double last_m, Visit visit) const;

  // Calls visit(ids, count) with groups of triangles whose boxes meet the box.
  template <typename Visit>
  void VisitInBox(const Eigen::Vector3f& min_m, const Eigen::Vector3f& max_m, Visit visit) const;

  uint64_t MemoryBytes() const {
    return nodes_.capacity() * sizeof(Node) + order_.capacity() * sizeof(uint32_t);
  }

 private:
  static constexpr int kLeafBits = 4;  // a leaf's reference: first << 4 | count, with the top bit
  static constexpr uint32_t kLeaf = 0x80000000u;
  static constexpr uint32_t kEmpty = 0xFFFFFFFFu;
  static constexpr int kMostInLeaf = 8;
  // Deeper than this, ranges are halved, whatever the cost: at most 22 more levels for 4 million triangles.
  // Seven children a level may wait, so the stack never overflows.
  static constexpr int kDepthOfHalves = 12;
  static constexpr int kStack = 256;

  struct alignas(32) Node {
    float bounds[6][8];  // min x, max x, min y, max y, min z, max z of the eight children
    uint32_t child[8];   // a node, a leaf or kEmpty
  };
  struct Primitive;
  struct Range;
  static Range Whole(const Primitive* primitives, uint32_t begin, uint32_t end);
  static uint32_t Split(Primitive* primitives, const Range& range, int depth);
  static int SplitInEight(Primitive* primitives, const Range& range, int depth, Range* children);
  static uint32_t Build(Primitive* primitives, const Range& range, int depth, std::vector<Node>* nodes);

  std::vector<Node> nodes_;      // the root is the first
  std::vector<uint32_t> order_;  // triangles, leaf after leaf
};

template <typename Visit>
void TriangleTree::VisitAlong(const Eigen::Vector3d& origin_m, const Eigen::Vector3d& direction,
                              double grow_m, double first_m, double last_m, Visit visit) const {
  // Slabs: a box is met between the largest entry and the smallest exit. A direction along a slab gets a huge
  // inverse instead of infinity, so that no 0 * infinity arises.
  float origin[3], inverse[3];
  int near_side[3];
  for (int axis = 0; axis < 3; ++axis) {
    origin[axis] = static_cast<float>(origin_m[axis]);
    const float along = static_cast<float>(direction[axis]);
    inverse[axis] = std::fabs(along) > 1e-12f ? 1.0f / along : std::copysign(1e12f, along);
    near_side[axis] = 2 * axis + (inverse[axis] < 0 ? 1 : 0);
  }
  const float grow = static_cast<float>(grow_m) * 1.0001f;
  const float first = static_cast<float>(first_m);
  struct Entry {
    float entry;
    uint32_t child;
  };
  Entry stack[kStack];
  int size = 0;
  stack[size++] = {first, 0};
  while (size > 0) {
    const Entry top = stack[--size];
    if (top.entry > last_m) continue;
    if (top.child & kLeaf) {
      const uint32_t begin = (top.child & ~kLeaf) >> kLeafBits;
      visit(order_.data() + begin, static_cast<int>(top.child & ((1 << kLeafBits) - 1)), &last_m);
      continue;
    }
    const Node& node = nodes_[top.child];
    Float8 entry = Float8{} + first;
    // The exit is widened by a few roundings; an entry that is a little late is covered by grow_m.
    Float8 leave = Float8{} + static_cast<float>(last_m);
    for (int axis = 0; axis < 3; ++axis) {
      const float outward = inverse[axis] < 0 ? grow : -grow;
      const Float8 close =
          (LoadLanes<Float8>(node.bounds[near_side[axis]]) + (outward - origin[axis])) * inverse[axis];
      const Float8 far =
          (LoadLanes<Float8>(node.bounds[near_side[axis] ^ 1]) - (outward + origin[axis])) * inverse[axis];
      entry = MaxLanes(entry, close);
      leave = MinLanes(leave, far);
    }
    uint32_t met = BitsOf(entry <= leave);
    float entries[8];
    StoreLanes(entries, entry);
    const int base = size;
    while (met) {
      const int lane = __builtin_ctz(met);
      met &= met - 1;
      if (node.child[lane] == kEmpty) continue;
      // Sorted as they are pushed, the nearest on top.
      int at = size++;
      for (; at > base && stack[at - 1].entry < entries[lane]; --at) stack[at] = stack[at - 1];
      stack[at] = {entries[lane], node.child[lane]};
    }
  }
}

template <typename Visit>
void TriangleTree::VisitInBox(const Eigen::Vector3f& min_m, const Eigen::Vector3f& max_m, Visit visit) const {
  uint32_t stack[kStack];
  int size = 0;
  stack[size++] = 0;
  while (size > 0) {
    const uint32_t top = stack[--size];
    if (top & kLeaf) {
      visit(order_.data() + ((top & ~kLeaf) >> kLeafBits), static_cast<int>(top & ((1 << kLeafBits) - 1)));
      continue;
    }
    const Node& node = nodes_[top];
    Float8 gap = Float8{} - 1.0f;
    for (int axis = 0; axis < 3; ++axis) {
      gap = MaxLanes(gap, LoadLanes<Float8>(node.bounds[2 * axis]) - max_m[axis]);
      gap = MaxLanes(gap, min_m[axis] - LoadLanes<Float8>(node.bounds[2 * axis + 1]));
    }
    for (uint32_t met = BitsOf(gap <= Float8{}); met; met &= met - 1) {
      const int lane = __builtin_ctz(met);
      if (node.child[lane] != kEmpty) stack[size++] = node.child[lane];
    }
  }
}

}  // namespace touchstone
