#include "server/geometry/search.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include <cmath>
#include <thread>

#include "server/base/check.h"

namespace touchstone {
namespace {

// Embree counts its memory a device; builds and releases take turns, so that the difference is one scene's.
std::mutex& BuildTurn() {
  static std::mutex* turn = new std::mutex;
  return *turn;
}
std::atomic<int64_t> embree_bytes{0};

RTCDevice NewDevice() {
  const RTCDevice device = rtcNewDevice(nullptr);
  TOUCHSTONE_CHECK(device != nullptr);
  rtcSetDeviceMemoryMonitorFunction(
      device,
      [](void*, ssize_t bytes, bool) {
        embree_bytes += bytes;
        return true;
      },
      nullptr);
  return device;
}

// The vertices moved outwards by a hair. Single precision may miss a triangle that a line meets right at its
// border; where the border is a silhouette, nothing but a surface far behind would be proposed. On the grown
// mesh the line passes well inside, something near the border is proposed, and the exact search is asked.
std::vector<Eigen::Vector3f> GrowVertices(const TriangleMesh& mesh, double distance_m) {
  // A border vertex is one whose triangles' opposite edges do not add up to a closed loop; it is moved away
  // from its triangles too.
  std::vector<Eigen::Vector3f> normal(mesh.vertices_m.size(), Eigen::Vector3f::Zero());
  std::vector<Eigen::Vector3f> loop(mesh.vertices_m.size(), Eigen::Vector3f::Zero());
  std::vector<Eigen::Vector3f> inwards(mesh.vertices_m.size(), Eigen::Vector3f::Zero());
  float longest_edge = 0;
  for (const auto& triangle : mesh.triangles) {
    const Eigen::Vector3f* corner[3];
    for (int c = 0; c < 3; ++c) corner[c] = &mesh.vertices_m[triangle[c]];
    const Eigen::Vector3f unit = (*corner[1] - *corner[0]).cross(*corner[2] - *corner[0]).stableNormalized();
    for (int c = 0; c < 3; ++c) {
      const Eigen::Vector3f &here = *corner[c], &next = *corner[(c + 1) % 3], &last = *corner[(c + 2) % 3];
      const float length = (next - last).norm();
      longest_edge = std::max(longest_edge, length);
      normal[triangle[c]] += unit;
      loop[triangle[c]] += last - next;
      inwards[triangle[c]] += (0.5f * (next + last) - here).stableNormalized();
    }
  }
  const float distance = static_cast<float>(distance_m);
  std::vector<Eigen::Vector3f> grown;
  grown.reserve(mesh.vertices_m.size() +
                2);  // Embree reads vertices in 16 bytes, a little beyond the last one
  for (size_t v = 0; v < mesh.vertices_m.size(); ++v) {
    Eigen::Vector3f move = normal[v].stableNormalized();
    if (loop[v].norm() > 1e-5f * longest_edge) move -= inwards[v].stableNormalized();
    grown.push_back(mesh.vertices_m[v] + distance * move);
  }
  return grown;
}

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

Surface::Search::Search(const TriangleMesh& mesh, const Bounds& bounds)
    : mesh_(mesh), centre_m_(bounds.Centre()), crowded_(new std::atomic<uint8_t>[mesh.triangles.size()]()) {
  reach_m_ = 0.5 * bounds.DiagonalM() * 1.0001;
  // Rounding of a coordinate is 6e-8 of it; sums and products of a few of them follow.
  rounding_m_ = 5e-7 * (bounds.min_m.cwiseAbs().cwiseMax(bounds.max_m.cwiseAbs()).maxCoeff() + reach_m_);
  grown_vertices_m_ = GrowVertices(mesh, rounding_m_);

  const std::lock_guard<std::mutex> turn(BuildTurn());
  const int64_t before = embree_bytes;
  const RTCDevice device = EmbreeDevice();
  const RTCScene scene = rtcNewScene(device);
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_MEDIUM);
  const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, grown_vertices_m_.data(),
                             0, sizeof(Eigen::Vector3f), grown_vertices_m_.size());
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.triangles.data(), 0,
                             sizeof(mesh.triangles[0]), mesh.triangles.size());
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
  return scene_bytes_ + grown_vertices_m_.capacity() * sizeof(grown_vertices_m_[0]) + mesh_.triangles.size() +
         tree_bytes_.load(std::memory_order_acquire) + curvature_bytes_.load(std::memory_order_acquire);
}

}  // namespace touchstone
