// An eight-wide tree of boxes over a mesh's triangles: finds every triangle whose box, inflated by a radius,
// meets a line. It errs only towards too many, so what is tested exactly afterwards does not depend on it. It
// serves swept spheres of any radius and the few lines that single precision cannot decide. About ten bytes
// per triangle.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "server/geometry/lanes.h"
#include "server/geometry/mesh/mesh.h"

namespace touchstone::geometry {

class TriangleTree {
 public:
  // The result depends on the mesh alone; `threads` shortens the wait.
  TriangleTree(const TriangleMesh& mesh, int threads);

  // Calls visit(ids, count, &last_m) with groups of at most eight triangles whose boxes, inflated by
  // inflate_m on every side, meet the points origin + t * direction with 0 <= t <= last_m; roughly nearest
  // first. visit may lower last_m. inflate_m must cover the rounding of coordinates to single precision.
  template <typename Visit>
  void VisitAlong(const Eigen::Vector3d& origin_m, const Eigen::Vector3d& direction, double inflate_m,
                  double last_m, Visit visit) const;

  // The same for a sphere of radius_m, rounding included, that moves along the line: the boxes that it
  // reaches.
  template <typename Visit>
  void VisitSwept(const Eigen::Vector3d& origin_m, const Eigen::Vector3d& direction, double radius_m,
                  double last_m, Visit visit) const;

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
  static constexpr int kMaxInLeaf = 8;
  static constexpr uint32_t kFull = 8 * 8 * kMaxInLeaf;  // what two levels of nodes hold
  // Deeper than this, ranges are halved, whatever the cost: at most 22 more levels for 4 million triangles.
  // Seven children per level may wait, so the stack never overflows.
  static constexpr int kDepthOfHalves = 12;
  static constexpr int kStack = 256;

  struct alignas(32) Node {
    float bounds[6][8];  // min x, max x, min y, max y, min z, max z of the eight children
    uint32_t child[8];   // a node, a leaf or kEmpty
  };
  template <typename Reach, typename Visit>
  void VisitReached(Reach reach, double last_m, Visit visit) const;
  struct Primitive;
  struct Range;
  static Range Whole(const Primitive* primitives, uint32_t begin, uint32_t end);
  static uint32_t Split(Primitive* primitives, const Range& range, int depth);
  static int SplitInEight(Primitive* primitives, const Range& range, int depth, Range* children);
  static uint32_t Build(Primitive* primitives, const Range& range, int depth, std::vector<Node>* nodes);

  std::vector<Node> nodes_;      // the root is the first
  std::vector<uint32_t> order_;  // triangles, leaf after leaf
};

// Depth first. reach(node, last_m, &entry) gives a bit for every child that is reached by last_m, and from
// where on.
template <typename Reach, typename Visit>
void TriangleTree::VisitReached(Reach reach, double last_m, Visit visit) const {
  struct Entry {
    float entry;
    uint32_t child;
  };
  Entry stack[kStack];
  int size = 0;
  stack[size++] = {0, 0};
  while (size > 0) {
    const Entry top = stack[--size];
    if (top.entry > last_m) continue;
    if (top.child & kLeaf) {
      const uint32_t begin = (top.child & ~kLeaf) >> kLeafBits;
      visit(order_.data() + begin, static_cast<int>(top.child & ((1 << kLeafBits) - 1)), &last_m);
      continue;
    }
    const Node& node = nodes_[top.child];
    Float8 entry;
    uint32_t reached = BitsOf(reach(node, static_cast<float>(last_m), &entry));
    float entries[8];
    StoreLanes(entries, entry);
    const int base = size;
    while (reached) {
      const int lane = __builtin_ctz(reached);
      reached &= reached - 1;
      if (node.child[lane] == kEmpty) continue;
      // Sorted as they are pushed, the nearest on top.
      int at = size++;
      for (; at > base && stack[at - 1].entry < entries[lane]; --at) stack[at] = stack[at - 1];
      stack[at] = {entries[lane], node.child[lane]};
    }
  }
}

template <typename Visit>
void TriangleTree::VisitAlong(const Eigen::Vector3d& origin_m, const Eigen::Vector3d& direction,
                              double inflate_m, double last_m, Visit visit) const {
  // Slabs: a box is met between the largest entry and the smallest exit. A direction along a slab gets a huge
  // inverse instead of infinity, so that no 0 * infinity arises.
  float origin[3], inverse[3], outward[3];
  int near_side[3];
  for (int axis = 0; axis < 3; ++axis) {
    origin[axis] = static_cast<float>(origin_m[axis]);
    const float along = static_cast<float>(direction[axis]);
    inverse[axis] = std::fabs(along) > 1e-12f ? 1.0f / along : std::copysign(1e12f, along);
    near_side[axis] = 2 * axis + (inverse[axis] < 0 ? 1 : 0);
    outward[axis] = static_cast<float>(inflate_m) * (inverse[axis] < 0 ? 1.0f : -1.0f);
  }
  const auto reach = [&](const Node& node, float last, Float8* entry) {
    *entry = Float8{};
    Float8 leave = Float8{} + last;
    for (int axis = 0; axis < 3; ++axis) {
      const Float8 near = LoadLanes<Float8>(node.bounds[near_side[axis]]);
      const Float8 far = LoadLanes<Float8>(node.bounds[near_side[axis] ^ 1]);
      *entry = MaxLanes(*entry, (near + (outward[axis] - origin[axis])) * inverse[axis]);
      leave = MinLanes(leave, (far - (outward[axis] + origin[axis])) * inverse[axis]);
    }
    return *entry <= leave;
  };
  VisitReached(reach, last_m, visit);
}

template <typename Visit>
void TriangleTree::VisitSwept(const Eigen::Vector3d& origin_m, const Eigen::Vector3d& direction,
                              double radius_m, double last_m, Visit visit) const {
  // In axes along and across the line a box has a middle and half extents. A sphere whose line passes the box
  // at a distance meets it no sooner than where a point of the box's near side, that far off, would be met.
  Eigen::Vector3d axes[3];
  axes[0] = direction;
  axes[1] = direction.unitOrthogonal();
  axes[2] = direction.cross(axes[1]);
  float axis_x[3], axis_y[3], axis_z[3], start[3];
  for (int i = 0; i < 3; ++i) {
    axis_x[i] = static_cast<float>(0.5 * axes[i].x());  // half: the boxes below are twice as large
    axis_y[i] = static_cast<float>(0.5 * axes[i].y());
    axis_z[i] = static_cast<float>(0.5 * axes[i].z());
    start[i] = static_cast<float>(axes[i].dot(origin_m));
  }
  const float radius = static_cast<float>(radius_m);
  const auto reach = [&](const Node& node, float last, Float8* entry) {
    const Triple<Float8> low = {LoadLanes<Float8>(node.bounds[0]), LoadLanes<Float8>(node.bounds[2]),
                                LoadLanes<Float8>(node.bounds[4])};
    const Triple<Float8> high = {LoadLanes<Float8>(node.bounds[1]), LoadLanes<Float8>(node.bounds[3]),
                                 LoadLanes<Float8>(node.bounds[5])};
    const Triple<Float8> sum = high + low, side = high - low;
    Float8 middle[3], half[3];
    for (int i = 0; i < 3; ++i) {
      middle[i] = sum.x * axis_x[i] + sum.y * axis_y[i] + sum.z * axis_z[i] - start[i];
      half[i] = side.x * std::fabs(axis_x[i]) + side.y * std::fabs(axis_y[i]) + side.z * std::fabs(axis_z[i]);
    }
    const Float8 u = MaxLanes(MaxLanes(middle[1], -middle[1]) - half[1], Float8{});
    const Float8 v = MaxLanes(MaxLanes(middle[2], -middle[2]) - half[2], Float8{});
    const Float8 left = radius * radius - u * u - v * v;
    const Float8 ahead = SquareRoot(MaxLanes(left, Float8{}));
    *entry = MaxLanes(middle[0] - half[0] - ahead, Float8{});
    return (left >= 0) & (*entry <= last) & (middle[0] + half[0] + radius >= 0);
  };
  VisitReached(reach, last_m, visit);
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

}  // namespace touchstone::geometry
