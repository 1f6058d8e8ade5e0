#include "server/geometry/surface/surface.h"

#include <absl/strings/str_cat.h>

#include <cmath>
#include <future>
#include <utility>

#include "server/base/status.h"
#include "server/geometry/surface/search.h"

namespace touchstone::geometry {
namespace {

absl::Status CheckMesh(const std::string& name, const TriangleMesh& mesh) {
  if (mesh.triangles.empty())
    return absl::InvalidArgumentError(
        absl::StrCat("mesh '", name, "' has no triangles; there is nothing to touch"));
  if (mesh.triangles.size() > Surface::kMaxTriangles)
    return absl::InvalidArgumentError(absl::StrCat("mesh '", name, "' has ", mesh.triangles.size(),
                                                   " triangles; at most ", Surface::kMaxTriangles,
                                                   " are allowed"));
  for (size_t v = 0; v < mesh.vertices_m.size(); ++v) {
    const Eigen::Vector3f& p = mesh.vertices_m[v];
    // Squares of coordinates must fit single precision.
    if (!p.allFinite() || p.cwiseAbs().maxCoeff() >= 1e6f)
      return absl::InvalidArgumentError(absl::StrCat("mesh '", name, "', vertex ", v, ": (", p.x(), ", ",
                                                     p.y(), ", ", p.z(),
                                                     ") m; coordinates must be finite and less than 1e6 m"));
  }
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const uint32_t v : mesh.triangles[t]) {
      if (v >= mesh.vertices_m.size())
        return absl::InvalidArgumentError(absl::StrCat("mesh '", name, "', triangle ", t, ": vertex ", v,
                                                       " does not exist; there are ",
                                                       mesh.vertices_m.size()));
    }
  }
  return absl::OkStatus();
}

}  // namespace

void Contacts::Resize(size_t count) {
  travel_m.resize(count);
  normal.resize(count);
  point_m.resize(count);
  triangle.resize(count);
}

Surface::Surface() = default;
Surface::~Surface() = default;

absl::StatusOr<std::shared_ptr<const Surface>> Surface::Create(std::string name, TriangleMesh mesh) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckMesh(name, mesh));
  std::shared_ptr<Surface> surface(new Surface);
  const size_t given = mesh.triangles.size();
  surface->mesh_ = WithoutDegenerateAndDuplicate(std::move(mesh));
  if (surface->mesh_.triangles.empty())
    return absl::InvalidArgumentError(
        absl::StrCat("mesh '", name, "': none of its ", given, " triangles has an area; is its unit right?"));
  surface->mesh_.vertices_m.shrink_to_fit();
  surface->mesh_.triangles.shrink_to_fit();
  surface->name_ = std::move(name);
  // The hash takes as long as a tenth of the rest and needs nothing of it.
  std::future<std::string> hash =
      std::async(std::launch::async, [&mesh = surface->mesh_] { return MeshHash(mesh); });
  surface->bounds_ = ComputeBounds(surface->mesh_);
  surface->search_ = std::make_unique<Search>(surface->mesh_, surface->bounds_);
  surface->hash_ = hash.get();
  if (surface->search_->scene() == nullptr)
    return absl::ResourceExhaustedError(
        absl::StrCat("mesh '", surface->name_, "' with ", surface->mesh_.triangles.size(),
                     " triangles: Embree could not build its search structure; is there enough memory?"));
  return surface;
}

void Surface::CastLines(absl::Span<const Eigen::Vector3d> origins_m,
                        absl::Span<const Eigen::Vector3d> directions, double longest_m,
                        Contacts* contacts) const {
  contacts->Resize(origins_m.size());
  search_->Cast(origins_m, directions, longest_m, contacts);
}

double Surface::MeanCurvaturePerM(uint32_t triangle, const Eigen::Vector3d& point_m) const {
  return search_->MeanCurvaturePerM(triangle, point_m);
}

void* Surface::embree_scene() const {
  return search_->scene();
}

uint64_t Surface::MemoryBytes() const {
  return mesh_.vertices_m.capacity() * sizeof(mesh_.vertices_m[0]) +
         mesh_.triangles.capacity() * sizeof(mesh_.triangles[0]) + search_->MemoryBytes();
}

}  // namespace touchstone::geometry
