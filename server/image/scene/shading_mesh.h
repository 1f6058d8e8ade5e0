// The mesh that renderers draw: positions with smooth normals, split at creases.
#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "server/geometry/surface/surface.h"

namespace touchstone::image {

struct ShadingMesh {
  struct Vertex {
    float position_m[3];
    float normal[3];  // unit
  };
  std::vector<Vertex> vertices;
  std::vector<uint32_t> corners;  // three a triangle; triangle i is the surface's triangle i
  // Closed, and wound counter-clockwise seen from outside everywhere: from outside no back face can be seen.
  // Meshes that are inside out as a whole are turned, so this holds for them too.
  bool outward = false;

  uint64_t MemoryBytes() const {
    return vertices.size() * sizeof(Vertex) + corners.size() * sizeof(uint32_t);
  }
};

// Normals: around a vertex position, triangles are joined across every edge whose two triangles turn by less
// than kCreaseRad (and run along it in opposite directions); a joined group shares the area-weighted mean of
// its triangles' normals. Positions that are equal bit for bit count as one, however the file indexed them.
ShadingMesh MakeShadingMesh(const geometry::Surface& surface);

// Shading meshes of the surfaces that were drawn last, each computed once. An entry goes when its surface has
// died (seen at the next call), when there are more than kMaxEntries, or when together they take more than
// kMaxBytes; whoever still draws keeps his own. Safe to call from several threads.
class ShadingMeshCache {
 public:
  static constexpr size_t kMaxEntries = 64;
  static constexpr uint64_t kMaxBytes = uint64_t{1} << 30;

  std::shared_ptr<const ShadingMesh> Get(const std::shared_ptr<const geometry::Surface>& surface);
  size_t size() const;

 private:
  struct Entry {
    std::weak_ptr<const geometry::Surface> surface;
    std::shared_future<std::shared_ptr<const ShadingMesh>> mesh;
    uint64_t last_use = 0;
    uint64_t bytes = 0;
  };
  void DropSome(const geometry::Surface* newest);

  mutable std::mutex mutex_;
  std::unordered_map<const geometry::Surface*, Entry> entries_;
  uint64_t uses_ = 0;
};

}  // namespace touchstone::image
