#include "server/geometry/surface/search.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include <cmath>
#include <mutex>
#include <new>
#include <thread>

#include "server/geometry/mesh/pieces.h"

namespace touchstone::geometry {
namespace {

// Embree counts its memory a device; builds and releases take turns, so that the difference is one scene's.
std::mutex& BuildTurn() {
  static std::mutex* turn = new std::mutex;
  return *turn;
}
std::atomic<int64_t> embree_bytes{0};

RTCDevice NewDevice() {
  const RTCDevice device = rtcNewDevice(nullptr);
  // Its threads and tables are all that it asks for here.
  if (device == nullptr) throw std::bad_alloc();
  rtcSetDeviceMemoryMonitorFunction(
      device,
      [](void*, ssize_t bytes, bool) {
        embree_bytes += bytes;
        return true;
      },
      nullptr);
  return device;
}

// The vertices moved so that every face, and every border edge in its plane, comes to lie `distance_m`
// farther out. Single precision may miss a triangle that a line meets right at its border; where the border
// is a silhouette, nothing but a surface far behind would be proposed. On the inflated mesh the line passes
// well inside, something near the border is proposed, and the exact search is asked.
class VertexInflation {
 public:
  VertexInflation(const TriangleMesh& mesh, double distance_m)
      : mesh_(mesh),
        distance_m_(static_cast<float>(distance_m)),
        normal_(mesh.vertices_m.size(), Eigen::Vector3f::Zero()),
        outwards_(normal_.size(), Eigen::Vector3f::Zero()),
        loop_(normal_.size(), Eigen::Vector3f::Zero()),
        lift_(normal_.size(), 1.0f) {}

  // Vertices are shared among the cores. Each sums over its own triangles in their order, whoever does it, so the
  // bits do not depend on the number of cores; triangles between two pieces are looked at twice.
  std::vector<Eigen::Vector3f> Inflated() {
    InPieces(normal_.size(), [this](size_t begin, size_t end) { SumFaces(begin, end); });
    std::vector<Eigen::Vector3f> inflated;
    inflated.reserve(normal_.size() + 2);  // Embree reads vertices in 16 bytes, a little beyond the last one
    inflated.resize(normal_.size());
    InPieces(normal_.size(), [&](size_t begin, size_t end) { Move(begin, end, inflated.data()); });
    return inflated;
  }

 private:
  // Calls body(triangle) for the triangles with a corner among the vertices begin .. end - 1.
  template <typename Body>
  void ForTrianglesAt(size_t begin, size_t end, const Body& body) const {
    const uint32_t size = static_cast<uint32_t>(end - begin), first = static_cast<uint32_t>(begin);
    for (const auto& triangle : mesh_.triangles)
      if ((triangle[0] - first < size) | (triangle[1] - first < size) | (triangle[2] - first < size))
        body(triangle);
  }

  // The corners and the unit normal of a triangle.
  Eigen::Vector3f Corners(const std::array<uint32_t, 3>& triangle, Eigen::Vector3f* corner) const {
    for (int c = 0; c < 3; ++c) corner[c] = mesh_.vertices_m[triangle[c]];
    return (corner[1] - corner[0]).cross(corner[2] - corner[0]).stableNormalized();
  }

  void SumFaces(size_t begin, size_t end) {
    float longest_edge_m = 0;
    Eigen::Vector3f corner[3];
    ForTrianglesAt(begin, end, [&](const std::array<uint32_t, 3>& triangle) {
      const Eigen::Vector3f unit = Corners(triangle, corner);
      Eigen::Vector3f away[3];
      for (int c = 0; c < 3; ++c) {
        const Eigen::Vector3f edge = corner[(c + 1) % 3] - corner[c];
        longest_edge_m = std::max(longest_edge_m, edge.norm());
        away[c] = edge.stableNormalized().cross(unit);
      }
      for (int c = 0; c < 3; ++c) {
        const uint32_t v = triangle[c];
        if (v < begin || v >= end) continue;
        normal_[v] += unit;
        outwards_[v] += away[c] + away[(c + 2) % 3];
        loop_[v] += corner[(c + 2) % 3] - corner[(c + 1) % 3];
      }
    });
    for (size_t v = begin; v < end; ++v) normal_[v] = normal_[v].stableNormalized();
    const std::lock_guard<std::mutex> lock(longest_mutex_);
    longest_edge_m_ = std::max(longest_edge_m_, longest_edge_m);
  }

  void Move(size_t begin, size_t end, Eigen::Vector3f* inflated) {
    // How much farther a sharp tip must go than the faces round it, within reason.
    Eigen::Vector3f corner[3];
    ForTrianglesAt(begin, end, [&](const std::array<uint32_t, 3>& triangle) {
      const Eigen::Vector3f unit = Corners(triangle, corner);
      for (const uint32_t v : triangle)
        if (v >= begin && v < end) lift_[v] = std::min(lift_[v], std::max(0.2f, unit.dot(normal_[v])));
    });
    for (size_t v = begin; v < end; ++v) {
      // A border seen at a flat angle moves less than its plane's distance; fifty times is enough to 1 degree.
      const bool border = loop_[v].norm() > 1e-5f * longest_edge_m_;
      const float square = std::max(1e-6f, outwards_[v].squaredNorm());
      const float factor = border ? 50 * 2 / square : 1 / lift_[v];
      const Eigen::Vector3f move = factor * (border ? outwards_[v] : normal_[v]);
      inflated[v] = mesh_.vertices_m[v] + distance_m_ * move;
    }
  }

  const TriangleMesh& mesh_;
  const float distance_m_;
  std::vector<Eigen::Vector3f> normal_;
  // In the faces' planes, away from the edges that meet at the vertex: the two sides of an inner edge cancel.
  std::vector<Eigen::Vector3f> outwards_;
  // The opposite edges: a closed loop, unless the vertex is on a border.
  std::vector<Eigen::Vector3f> loop_;
  std::vector<float> lift_;
  std::mutex longest_mutex_;
  float longest_edge_m_ = 0;
};

}  // namespace

RTCDevice EmbreeDevice() {
  static const RTCDevice device = NewDevice();  // never released: surfaces may outlive static objects
  return device;
}

int EmbreePacketWidth() {
  static const int width =
      rtcGetDeviceProperty(EmbreeDevice(), RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)  ? 16
      : rtcGetDeviceProperty(EmbreeDevice(), RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) ? 8
                                                                                        : 4;
  return width;
}

std::string EmbreeDescription() {
  const int width = EmbreePacketWidth();
  const char* const instructions = width == 16 ? "AVX-512" : width == 8 ? "AVX or AVX2" : "SSE or NEON";
  const auto version = rtcGetDeviceProperty(EmbreeDevice(), RTC_DEVICE_PROPERTY_VERSION);
  return absl::StrCat("Embree ", version / 10000, ".", version / 100 % 100, ".", version % 100, ", ",
                      instructions, ", packets of ", width);
}

namespace {

// A ray that starts on a triangle does not meet that triangle: its id says which.
void IgnoreOwnTriangle(const RTCFilterFunctionNArguments* args) {
  for (unsigned i = 0; i < args->N; ++i)
    if (args->valid[i] == -1 && RTCRayN_id(args->ray, args->N, i) == RTCHitN_primID(args->hit, args->N, i))
      args->valid[i] = 0;
}

}  // namespace

Surface::Search::Search(const TriangleMesh& mesh, const Bounds& bounds)
    : mesh_(mesh),
      centre_m_(bounds.Centre()),
      near_coincident_(new std::atomic<uint8_t>[mesh.triangles.size() / 4 + 1]()) {
  reach_m_ = 0.5 * bounds.DiagonalM() * 1.0001;
  // Rounding of a coordinate is 6e-8 of it; sums and products of a few of them follow.
  rounding_m_ = 5e-7 * (bounds.min_m.cwiseAbs().cwiseMax(bounds.max_m.cwiseAbs()).maxCoeff() + reach_m_);
  inflated_vertices_m_ = VertexInflation(mesh, rounding_m_).Inflated();

  const std::lock_guard<std::mutex> turn(BuildTurn());
  const int64_t before = embree_bytes;
  const RTCDevice device = EmbreeDevice();
  const RTCScene scene = rtcNewScene(device);
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_MEDIUM);
  const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                             inflated_vertices_m_.data(), 0, sizeof(Eigen::Vector3f),
                             inflated_vertices_m_.size());
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.triangles.data(), 0,
                             sizeof(mesh.triangles[0]), mesh.triangles.size());
  rtcSetGeometryOccludedFilterFunction(geometry, IgnoreOwnTriangle);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene);
  if (rtcGetDeviceError(device) != RTC_ERROR_NONE) {
    rtcReleaseScene(scene);
    return;
  }
  scene_ = scene;
  scene_bytes_ = static_cast<uint64_t>(std::max<int64_t>(0, embree_bytes - before));
}

Surface::Search::~Search() {
  if (scene_ == nullptr) return;
  const std::lock_guard<std::mutex> turn(BuildTurn());
  rtcReleaseScene(scene_);
}

const TriangleTree& Surface::Search::tree() const {
  std::call_once(tree_once_, [this] {
    const int threads = static_cast<int>(std::min(8u, std::max(1u, std::thread::hardware_concurrency())));
    tree_ = std::make_unique<TriangleTree>(mesh_, threads);
    tree_bytes_.store(tree_->MemoryBytes(), std::memory_order_release);
  });
  return *tree_;
}

uint64_t Surface::Search::MemoryBytes() const {
  return scene_bytes_ + inflated_vertices_m_.capacity() * sizeof(inflated_vertices_m_[0]) +
         mesh_.triangles.size() / 4 + 1 + tree_bytes_.load(std::memory_order_acquire) +
         curvature_bytes_.load(std::memory_order_acquire);
}

}  // namespace touchstone::geometry
