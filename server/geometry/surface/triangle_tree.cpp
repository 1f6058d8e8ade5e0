#include "server/geometry/surface/triangle_tree.h"

#include <atomic>
#include <thread>
#include <utility>

#include "server/base/check.h"

namespace touchstone::geometry {

// A triangle's box while the tree is built; moved about instead of an index, so that memory is read in order.
struct TriangleTree::Primitive {
  Eigen::Vector3f min, max;
  uint32_t triangle;
  float Middle(int axis) const { return min[axis] + max[axis]; }  // twice the centre; only compared
};

// Primitives begin .. end, their box, and the box of their middles.
struct TriangleTree::Range {
  uint32_t begin = 0, end = 0;
  Eigen::Vector3f min, max, middle_min, middle_max;

  uint32_t size() const { return end - begin; }
  float HalfArea() const {
    const Eigen::Vector3f side = max - min;
    return side.x() * side.y() + side.y() * side.z() + side.z() * side.x();
  }
};

TriangleTree::Range TriangleTree::Whole(const Primitive* primitives, uint32_t begin, uint32_t end) {
  Range range;
  range.begin = begin;
  range.end = end;
  range.min = range.middle_min = Eigen::Vector3f::Constant(std::numeric_limits<float>::max());
  range.max = range.middle_max = -range.min;
  for (uint32_t i = begin; i < end; ++i) {
    const Primitive& primitive = primitives[i];
    range.min = range.min.cwiseMin(primitive.min);
    range.max = range.max.cwiseMax(primitive.max);
    const Eigen::Vector3f middle = primitive.min + primitive.max;
    range.middle_min = range.middle_min.cwiseMin(middle);
    range.middle_max = range.middle_max.cwiseMax(middle);
  }
  return range;
}

// Puts the primitives of a range into two parts and returns where the second begins: of sixteen planes along
// the longest axis the one with the least sum of area times number (Wald, "On fast construction of SAH-based
// bounding volume hierarchies", 2007); halves if all middles coincide.
uint32_t TriangleTree::Split(Primitive* primitives, const Range& range, int depth) {
  constexpr int kBins = 16;
  int axis = 0;
  const Eigen::Vector3f extent = range.middle_max - range.middle_min;
  const float length = extent.maxCoeff(&axis);
  const uint32_t half = range.begin + range.size() / 2;
  // The last two levels become full nodes and leaves: memory counts, and their boxes are much alike.
  if (range.size() <= kFull) {
    const uint32_t part = range.size() <= kFull / 8 ? kMaxInLeaf : kFull / 8;
    const uint32_t first_part = (range.size() / 2 + part - 1) / part * part;
    Primitive* const middle = primitives + range.begin + first_part;
    std::nth_element(primitives + range.begin, middle, primitives + range.end,
                     [&](const Primitive& a, const Primitive& b) {
                       return std::make_pair(a.Middle(axis), a.triangle) <
                              std::make_pair(b.Middle(axis), b.triangle);
                     });
    return range.begin + first_part;
  }
  if (!(length > 0) || depth >= kDepthOfHalves) return half;
  const float first = range.middle_min[axis], scale = kBins * 0.9999f / length;
  const auto bin_of = [&](const Primitive& primitive) {
    return std::min(kBins - 1, static_cast<int>((primitive.Middle(axis) - first) * scale));
  };
  Range bins[kBins];
  for (Range& bin : bins) bin = Whole(nullptr, 0, 0);
  for (uint32_t i = range.begin; i < range.end; ++i) {
    Range& bin = bins[bin_of(primitives[i])];
    ++bin.end;
    bin.min = bin.min.cwiseMin(primitives[i].min);
    bin.max = bin.max.cwiseMax(primitives[i].max);
  }
  const auto join = [](Range* into, const Range& bin) {
    into->end += bin.end;
    into->min = into->min.cwiseMin(bin.min);
    into->max = into->max.cwiseMax(bin.max);
  };
  float left_cost[kBins] = {};
  Range left = Whole(nullptr, 0, 0);
  for (int i = 0; i < kBins - 1; ++i) {
    join(&left, bins[i]);
    left_cost[i] = left.end > 0 ? left.HalfArea() * left.end : 0;
  }
  Range right = Whole(nullptr, 0, 0);
  int best = -1;
  float min_cost = std::numeric_limits<float>::max();
  for (int i = kBins - 1; i > 0; --i) {
    join(&right, bins[i]);
    if (right.end == 0 || right.end == range.size()) continue;
    const float cost = left_cost[i - 1] + right.HalfArea() * right.end;
    if (cost < min_cost) {
      min_cost = cost;
      best = i;
    }
  }
  if (best < 0) return half;
  const auto* second = std::partition(primitives + range.begin, primitives + range.end,
                                      [&](const Primitive& primitive) { return bin_of(primitive) < best; });
  return static_cast<uint32_t>(second - primitives);
}

// The children of a node: the part with the largest area (near the leaves, of the largest number) is split
// until there are eight.
int TriangleTree::SplitInEight(Primitive* primitives, const Range& range, int depth, Range* children) {
  int count = 1;
  children[0] = range;
  while (count < 8) {
    int widest = -1;
    for (int i = 0; i < count; ++i) {
      if (children[i].size() <= kMaxInLeaf) continue;
      const bool wider =
          widest < 0 || (range.size() <= kFull ? children[i].size() > children[widest].size()
                                               : children[i].HalfArea() > children[widest].HalfArea());
      if (wider) widest = i;
    }
    if (widest < 0) break;
    const Range parent = children[widest];
    const uint32_t middle = Split(primitives, parent, depth);
    children[widest] = Whole(primitives, parent.begin, middle);
    children[count++] = Whole(primitives, middle, parent.end);
  }
  return count;
}

uint32_t TriangleTree::Build(Primitive* primitives, const Range& range, int depth, std::vector<Node>* nodes) {
  if (range.size() <= kMaxInLeaf) return kLeaf | range.begin << kLeafBits | range.size();
  const uint32_t self = static_cast<uint32_t>(nodes->size());
  nodes->emplace_back();
  Range children[8];
  const int count = SplitInEight(primitives, range, depth, children);
  for (int i = 0; i < 8; ++i) {
    const uint32_t child = i < count ? Build(primitives, children[i], depth + 1, nodes) : kEmpty;
    Node& node = (*nodes)[self];
    node.child[i] = child;
    for (int axis = 0; axis < 3; ++axis) {
      node.bounds[2 * axis][i] = i < count ? children[i].min[axis] : 1e30f;
      node.bounds[2 * axis + 1][i] = i < count ? children[i].max[axis] : -1e30f;
    }
  }
  return self;
}

TriangleTree::TriangleTree(const TriangleMesh& mesh, int threads) {
  const uint32_t count = static_cast<uint32_t>(mesh.triangles.size());
  TOUCHSTONE_CHECK(count < (kLeaf >> kLeafBits));
  std::vector<Primitive> primitives(count);
  for (uint32_t i = 0; i < count; ++i) {
    const auto& [a, b, c] = mesh.triangles[i];
    const Eigen::Vector3f &p = mesh.vertices_m[a], &q = mesh.vertices_m[b], &r = mesh.vertices_m[c];
    primitives[i] = {p.cwiseMin(q).cwiseMin(r), p.cwiseMax(q).cwiseMax(r), i};
  }
  // The root's children are built side by side, then joined in their order: the same tree for any number.
  Range children[8];
  const int parts = SplitInEight(primitives.data(), Whole(primitives.data(), 0, count), 0, children);
  std::vector<Node> subtrees[8];
  uint32_t roots[8];
  std::atomic<int> next{0};
  const auto work = [&] {
    for (int i = next++; i < parts; i = next++)
      roots[i] = Build(primitives.data(), children[i], 1, &subtrees[i]);
  };
  std::vector<std::thread> helpers;
  for (int i = 1; i < (count < 5000 ? 1 : threads); ++i) helpers.emplace_back(work);
  work();
  for (std::thread& helper : helpers) helper.join();

  size_t total = 1;
  for (const auto& subtree : subtrees) total += subtree.size();
  nodes_.reserve(total);
  nodes_.emplace_back();
  for (int i = 0; i < 8; ++i) {
    const uint32_t shift = static_cast<uint32_t>(nodes_.size());
    const auto moved = [&](uint32_t child) { return child & kLeaf ? child : child + shift; };
    nodes_[0].child[i] = i < parts ? moved(roots[i]) : kEmpty;
    for (int axis = 0; axis < 3; ++axis) {
      nodes_[0].bounds[2 * axis][i] = i < parts ? children[i].min[axis] : 1e30f;
      nodes_[0].bounds[2 * axis + 1][i] = i < parts ? children[i].max[axis] : -1e30f;
    }
    for (Node& node : subtrees[i]) {
      for (uint32_t& child : node.child) child = moved(child);
      nodes_.push_back(node);
    }
    std::vector<Node>().swap(subtrees[i]);
  }
  order_.resize(count);
  for (uint32_t i = 0; i < count; ++i) order_[i] = primitives[i].triangle;
}

}  // namespace touchstone::geometry
