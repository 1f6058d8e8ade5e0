#include "server/geometry/shapes/supershape.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <set>

#include "server/base/test_paths.h"
#include "server/base/test_tier.h"
#include "server/geometry/files/mesh_file.h"

namespace touchstone::geometry {
namespace {

// How far a point is from a surface along the line from the origin, in metres; written anew from the formula,
// without the code under test: the latitude's radius is what is left when the longitude's is divided out.
double OffSurfaceM(const Eigen::Vector3d& point_m, double latitude_n2, double scale_m) {
  const double theta = std::atan2(point_m.y(), point_m.x());
  const double round =
      std::pow(std::pow(std::abs(std::cos(theta)), 10) + std::pow(std::abs(std::sin(theta)), 10), -0.1);
  const double out_m = std::hypot(point_m.x(), point_m.y()) / round;
  const double phi = std::atan2(point_m.z(), out_m);
  const double radius =
      std::pow(std::pow(std::abs(std::cos(phi)), latitude_n2) + std::pow(std::abs(std::sin(phi)), 10), -0.1);
  return point_m.norm() * (1.0 - scale_m * radius / std::hypot(out_m, point_m.z()));
}

TriangleMesh Named(const std::string& name, uint64_t triangles) {
  return MakeSupershape(NamedSupershape(name).value(), triangles).value();
}

void ExpectWellMade(const TriangleMesh& mesh) {
  const MeshReport report = InspectMesh(mesh);
  EXPECT_TRUE(report.closed());
  EXPECT_EQ(report.inconsistent_edges, 0u);
  EXPECT_EQ(report.degenerate_triangles, 0u);
  EXPECT_EQ(report.duplicate_triangles, 0u);
  EXPECT_EQ(report.unused_vertices, 0u);
  EXPECT_GT(report.signed_volume_m3, 0);
  EXPECT_EQ(report.vertices, report.triangles / 2 + 2);  // Euler: one body without a hole
}

TEST(Supershape, FormulaHasItsKnownValues) {
  Superformula f;
  EXPECT_DOUBLE_EQ(f.Radius(0), 1);
  EXPECT_NEAR(f.Radius(M_PI / 4), std::pow(2 * std::pow(0.5, 5), -0.1), 1e-15);  // the corner: 2^0.4
  f.n2 = f.n3 = f.n1 = 2;
  for (double angle = 0; angle < 7; angle += 0.1) EXPECT_NEAR(f.Radius(angle), 1, 1e-14);  // a circle
  f.a = 3;
  EXPECT_DOUBLE_EQ(f.Radius(0), 3);  // an ellipse's half axes
  EXPECT_NEAR(f.Radius(M_PI / 2), 1, 1e-15);
  Superformula zero;
  zero.n2 = 0;
  EXPECT_DOUBLE_EQ(zero.Radius(0), 1);
  EXPECT_NEAR(zero.Radius(M_PI / 2), std::pow(2, -0.1), 1e-15);  // 0^0 is 1
}

TEST(Supershape, SphereHasItsRadiusAndVolume) {
  SupershapeParameters sphere;
  sphere.longitude = sphere.latitude = {0, 2, 2, 2, 1, 1};
  sphere.width_m = 0.2;
  const TriangleMesh mesh = MakeSupershape(sphere, 400'000).value();
  ExpectWellMade(mesh);
  // An inscribed body: a little less, by the square of its steps.
  const double volume = InspectMesh(mesh).signed_volume_m3 / (4.0 / 3.0 * M_PI * 1e-3);
  EXPECT_LT(volume, 1);
  EXPECT_GT(volume, 1 - 1e-4);
  for (const Eigen::Vector3f& vertex_m : mesh.vertices_m) ASSERT_NEAR(vertex_m.norm(), 0.1, 2e-8);
}

TEST(Supershape, TheFiveAreClosedAndOutwardAt150Millimetres) {
  for (const std::string& name : SupershapeNames()) {
    SCOPED_TRACE(name);
    const TriangleMesh mesh = Named(name, 20'000);
    ExpectWellMade(mesh);
    EXPECT_NEAR(mesh.triangles.size(), 20'000, 400);
    const Bounds bounds = ComputeBounds(mesh);
    EXPECT_NEAR(bounds.max_m.x() - bounds.min_m.x(), 0.150, 2e-8);
    EXPECT_NEAR(bounds.max_m.y() - bounds.min_m.y(), 0.150, 2e-8);
    EXPECT_EQ(bounds.Centre(), Eigen::Vector3d::Zero());
  }
}

TEST(Supershape, EveryVertexIsOnTheFormula) {
  for (int n2 : {0, 5, 10, 15, 20}) {
    const std::string name = std::string(n2 < 10 ? "lat0" : "lat") + std::to_string(n2);
    const double scale_m = SupershapeScaleM(NamedSupershape(name).value()).value();
    for (const Eigen::Vector3f& vertex_m : Named(name, 50'000).vertices_m)
      ASSERT_NEAR(OffSurfaceM(vertex_m.cast<double>(), n2, scale_m), 0, 2e-8)
          << name << " " << vertex_m.transpose();
  }
}

// Plans put touches at whole degrees; a meridian there would put every such touch on an edge.
TEST(Supershape, MeridiansKeepOffWholeDegreesButForTheShapesOwnEdges) {
  for (uint64_t triangles : {2'000, 20'000, 200'000, 2'000'000}) {
    const uint32_t around = SegmentsForTriangles(triangles)->around;
    for (uint32_t degrees = 0; degrees < 360; ++degrees) {
      const bool on_meridian = (uint64_t{degrees} * around) % 360 == 0;
      EXPECT_EQ(on_meridian, degrees % 45 == 0) << triangles << " triangles, " << degrees << " deg";
    }
  }
}

TEST(Supershape, AnyTessellationIsWellMade) {
  for (const std::string& name : SupershapeNames())
    for (uint64_t triangles : {48, 100, 2'000, 7'777, 300'000}) {
      SCOPED_TRACE(name + " " + std::to_string(triangles));
      const TriangleMesh mesh = Named(name, triangles);
      ExpectWellMade(mesh);
      EXPECT_NEAR(static_cast<double>(mesh.triangles.size()) / triangles, 1, triangles < 1000 ? 0.5 : 0.07);
    }
  for (const SupershapeSegments segments :
       {SupershapeSegments{3, 2}, {5, 3}, {7, 1001}, {1999, 4}, {100, 101}}) {
    SCOPED_TRACE(std::to_string(segments.around) + " x " + std::to_string(segments.from_pole_to_pole));
    const TriangleMesh mesh = MakeSupershape(NamedSupershape("lat20").value(), segments).value();
    EXPECT_EQ(mesh.triangles.size(), segments.Triangles());
    ExpectWellMade(mesh);
  }
}

TEST(Supershape, FourMillionTrianglesAreWellMade) {
  TOUCHSTONE_SECOND_TIER("long: four million triangles");
  for (const char* name : {"lat00", "lat20"}) {
    SCOPED_TRACE(name);
    const TriangleMesh mesh = Named(name, kMaxSupershapeTriangles);
    EXPECT_LE(mesh.triangles.size(), kMaxSupershapeTriangles);
    EXPECT_GT(mesh.triangles.size(), 3'900'000u);
    ExpectWellMade(mesh);
  }
}

TEST(Supershape, MirroredShapesAreMirroredBitForBit) {
  const TriangleMesh mesh = Named("lat15", 20'000);
  std::set<std::array<float, 3>> places;
  for (const Eigen::Vector3f& v : mesh.vertices_m) places.insert({v.x(), v.y(), v.z()});
  EXPECT_EQ(places.size(), mesh.vertices_m.size());
  for (const Eigen::Vector3f& v : mesh.vertices_m) {
    EXPECT_EQ(places.count({-v.x() + 0.0f, v.y(), v.z()}), 1u);
    EXPECT_EQ(places.count({v.x(), v.y(), -v.z() + 0.0f}), 1u);
    EXPECT_EQ(places.count({v.y(), v.x(), v.z()}), 1u);
  }
}

TEST(Supershape, ManyOtherFormulasAreWellMade) {
  const Superformula star = {6, 1, 1, 1, 1, 1}, flower = {8, 0.6, 0.55, 1, 1, 1}, egg = {4, 2, 2, 2, 1.5, 1},
                     odd = {5, 3, 3, 3, 1, 1}, fractional = {2.5, 2, 3, 4, 1, 1},
                     box = {4, 100, 100, 100, 1, 1};
  for (const Superformula& longitude : {star, flower, egg, odd, box})
    for (const Superformula& latitude : {star, egg, odd, fractional, box}) {
      const absl::StatusOr<TriangleMesh> mesh = MakeSupershape({longitude, latitude, 0.1}, 5'000);
      ASSERT_TRUE(mesh.ok()) << mesh.status();
      ExpectWellMade(*mesh);
    }
}

TEST(Supershape, RefusesWhatGivesNoSurface) {
  SupershapeParameters p;
  EXPECT_FALSE(MakeSupershape(p, 47).ok());
  EXPECT_FALSE(MakeSupershape(p, 4'000'001).ok());
  EXPECT_FALSE(MakeSupershape(p, SupershapeSegments{2, 10}).ok());
  EXPECT_FALSE(MakeSupershape(p, SupershapeSegments{0xFFFFFFFF, 0xFFFFFFFF}).ok());
  const auto refused = [](auto change) {
    SupershapeParameters wrong;
    change(&wrong);
    return !MakeSupershape(wrong, 1000).ok();
  };
  EXPECT_TRUE(refused([](auto* q) { q->latitude.n1 = 0; }));
  EXPECT_TRUE(refused([](auto* q) { q->latitude.a = 0; }));
  EXPECT_TRUE(refused([](auto* q) { q->longitude.m = 2.5; }));
  EXPECT_TRUE(refused([](auto* q) { q->longitude.m = 3, q->longitude.n2 = 5; }));
  EXPECT_TRUE(refused([](auto* q) { q->longitude.n3 = std::nan(""); }));
  EXPECT_TRUE(refused([](auto* q) { q->width_m = 0; }));
  EXPECT_TRUE(refused([](auto* q) { q->latitude.n1 = 1e-3, q->latitude.n2 = 1e3; }));
  const absl::Status unknown = NamedSupershape("lat2").status();
  EXPECT_NE(unknown.message().find("did you mean 'lat20'"), absl::string_view::npos) << unknown;
}

// Meshes of the same five that were made elsewhere: 256 x 128 segments, a line at every 180/128 deg.
TEST(Supershape, AgreesWithMeshesMadeElsewhere) {
  const std::string folder = SharedData() + "/measurements/";
  if (!std::filesystem::exists(folder + "lat20.off"))
    GTEST_SKIP() << "no meshes to compare with at " << folder;
  for (int n2 : {0, 5, 10, 15, 20}) {
    const std::string name = std::string(n2 < 10 ? "lat0" : "lat") + std::to_string(n2);
    SCOPED_TRACE(name);
    const TriangleMesh theirs = ReadMeshFile(folder + name + ".off").value();
    const double scale_m = SupershapeScaleM(NamedSupershape(name).value()).value();
    double max_m = 0, min_ratio = 1e9, max_ratio = 0;
    for (const Eigen::Vector3f& vertex_m : theirs.vertices_m) {
      const double off_m = OffSurfaceM(vertex_m.cast<double>(), n2, scale_m);
      const double ratio = 1.0 / (1.0 - off_m / vertex_m.cast<double>().norm());
      max_m = std::max(max_m, std::abs(off_m));
      min_ratio = std::min(min_ratio, ratio);
      max_ratio = std::max(max_ratio, ratio);
    }
    // The same surface up to one factor ...
    EXPECT_LT(max_ratio / min_ratio - 1, 5e-7);
    // ... which is 1 within what their lines miss of the widest latitude: they scaled their vertices to 150
    // mm, we scale the surface.
    EXPECT_LT(max_m, n2 <= 10 ? 1e-7 : 80e-6);
    const Bounds ours = ComputeBounds(Named(name, 65'024)), other = ComputeBounds(theirs);
    EXPECT_LT((ours.min_m - other.min_m).cwiseAbs().maxCoeff(), n2 <= 10 ? 1e-7 : 60e-6);
    EXPECT_LT((ours.max_m - other.max_m).cwiseAbs().maxCoeff(), n2 <= 10 ? 1e-7 : 60e-6);
    // Whoever uses our mesh for theirs errs by no more than their volumes differ.
    EXPECT_NEAR(InspectMesh(Named(name, 65'024)).signed_volume_m3 / InspectMesh(theirs).signed_volume_m3, 1,
                0.003);
  }
}

}  // namespace
}  // namespace touchstone::geometry
