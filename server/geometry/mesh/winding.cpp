#include "server/geometry/mesh/winding.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <tuple>

namespace touchstone::geometry {
namespace {

struct EdgeUse {
  uint32_t low, high;  // vertices
  uint32_t triangle;
  bool upward;  // from low to high
};

struct Neighbour {
  uint32_t triangle;
  bool agrees;  // both run through the edge in opposite directions
};

struct Part {
  std::vector<uint32_t> triangles;
  std::vector<bool> turned;  // against the first one
  bool has_outside = true;
  Bounds bounds;
};

class Winding {
 public:
  explicit Winding(const TriangleMesh& mesh)
      : mesh_(mesh), neighbours_(mesh.triangles.size()), open_(neighbours_.size()) {
    FindNeighbours();
    FindParts();
  }

  std::vector<uint32_t> Wrong() const {
    std::vector<uint32_t> wrong;
    for (const Part& part : parts_) {
      if (!part.has_outside) continue;
      const bool invert = MayBeCavity(part) ? 2 * std::count(part.turned.begin(), part.turned.end(), true) >
                                                  static_cast<std::ptrdiff_t>(part.turned.size())
                                            : VolumeOf(part) < 0;
      for (size_t k = 0; k < part.triangles.size(); ++k)
        if (part.turned[k] != invert) wrong.push_back(part.triangles[k]);
    }
    std::sort(wrong.begin(), wrong.end());
    return wrong;
  }

 private:
  void FindNeighbours() {
    const std::vector<uint32_t> place = FirstAtSamePlace(mesh_.vertices_m);
    std::vector<EdgeUse> uses;
    uses.reserve(3 * mesh_.triangles.size());
    for (uint32_t t = 0; t < mesh_.triangles.size(); ++t)
      for (int c = 0; c < 3; ++c) {
        const uint32_t from = place[mesh_.triangles[t][c]], to = place[mesh_.triangles[t][(c + 1) % 3]];
        if (from == to) open_[t] = true;  // shrunk to a line
        uses.push_back({std::min(from, to), std::max(from, to), t, from < to});
      }
    std::sort(uses.begin(), uses.end(), [](const EdgeUse& a, const EdgeUse& b) {
      return std::tie(a.low, a.high, a.triangle, a.upward) < std::tie(b.low, b.high, b.triangle, b.upward);
    });
    for (size_t begin = 0, end; begin < uses.size(); begin = end) {
      end = begin + 1;
      while (end < uses.size() && uses[end].low == uses[begin].low && uses[end].high == uses[begin].high)
        ++end;
      if (end - begin != 2) {
        for (size_t k = begin; k < end; ++k) open_[uses[k].triangle] = true;
        continue;
      }
      const bool agrees = uses[begin].upward != uses[begin + 1].upward;
      neighbours_[uses[begin].triangle].push_back({uses[begin + 1].triangle, agrees});
      neighbours_[uses[begin + 1].triangle].push_back({uses[begin].triangle, agrees});
    }
  }

  void FindParts() {
    enum : uint8_t { kUnseen, kAsFirst, kTurned };
    std::vector<uint8_t> state(mesh_.triangles.size(), kUnseen);
    for (uint32_t first = 0; first < state.size(); ++first) {
      if (state[first] != kUnseen) continue;
      Part& part = parts_.emplace_back();
      part.triangles.push_back(first);
      state[first] = kAsFirst;
      for (size_t k = 0; k < part.triangles.size(); ++k) {
        const uint32_t t = part.triangles[k];
        part.turned.push_back(state[t] == kTurned);
        part.has_outside = part.has_outside && !open_[t];
        for (int c = 0; c < 3; ++c) {
          part.bounds.min_m = part.bounds.min_m.cwiseMin(mesh_.Corner(t, c));
          part.bounds.max_m = part.bounds.max_m.cwiseMax(mesh_.Corner(t, c));
        }
        for (const Neighbour& next : neighbours_[t]) {
          const uint8_t expected = (state[t] == kTurned) == next.agrees ? kTurned : kAsFirst;
          if (state[next.triangle] == kUnseen) {
            state[next.triangle] = expected;
            part.triangles.push_back(next.triangle);
          } else if (state[next.triangle] != expected) {
            part.has_outside = false;  // one-sided, as a Moebius strip is
          }
        }
      }
    }
  }

  bool MayBeCavity(const Part& part) const {
    return std::any_of(parts_.begin(), parts_.end(), [&](const Part& other) {
      return &other != &part && other.has_outside &&
             (other.bounds.min_m.array() < part.bounds.min_m.array()).all() &&
             (other.bounds.max_m.array() > part.bounds.max_m.array()).all();
    });
  }

  // With every triangle wound as the first one; from the box's centre, so that no digits are lost far from the origin.
  double VolumeOf(const Part& part) const {
    double volume = 0;
    const Eigen::Vector3d centre = part.bounds.Centre();
    for (size_t k = 0; k < part.triangles.size(); ++k) {
      const uint32_t t = part.triangles[k];
      const Eigen::Vector3d a = mesh_.Corner(t, 0) - centre, b = mesh_.Corner(t, 1) - centre,
                            c = mesh_.Corner(t, 2) - centre;
      volume += (part.turned[k] ? -1 : 1) * a.dot(b.cross(c)) / 6;
    }
    return volume;
  }

  const TriangleMesh& mesh_;
  std::vector<std::vector<Neighbour>> neighbours_;
  std::vector<bool> open_;
  std::vector<Part> parts_;
};

}  // namespace

std::vector<uint32_t> WronglyWound(const TriangleMesh& mesh) {
  return Winding(mesh).Wrong();
}

void Turn(const std::vector<uint32_t>& triangles, TriangleMesh* mesh) {
  for (const uint32_t t : triangles) std::swap(mesh->triangles[t][1], mesh->triangles[t][2]);
}

}  // namespace touchstone::geometry
