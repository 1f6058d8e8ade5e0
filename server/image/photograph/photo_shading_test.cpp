// Light, highlights and shadows of a photograph against a small ray caster that tries every triangle in double precision.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "server/image/photograph/photo_test_scene.h"

namespace touchstone::image {
namespace {

// A box and a plate before it, towards the key light: flat faces, whose normals are those of their triangles.
geometry::TriangleMesh StepMesh() {
  geometry::TriangleMesh mesh;
  AddBox({-0.06, 0, -0.05}, {0.06, 0.02, 0.05}, &mesh);
  AddBox({-0.03, -0.05, 0.0}, {-0.015, -0.005, 0.04}, &mesh);
  AddBox({0.02, -0.02, -0.04}, {0.035, 0.0, 0.045}, &mesh);
  return mesh;
}

// Whether the segment from `from_m` to `to_m` meets a triangle other than `but`.
bool Meets(const geometry::TriangleMesh& mesh, const Eigen::Vector3d& from_m, const Eigen::Vector3d& to_m,
           uint32_t but) {
  const Eigen::Vector3d direction = to_m - from_m;
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (t == but) continue;
    const Eigen::Vector3d a = mesh.Corner(t, 0), e1 = mesh.Corner(t, 1) - a, e2 = mesh.Corner(t, 2) - a;
    const Eigen::Vector3d p = direction.cross(e2), s = from_m - a, q = s.cross(e1);
    const double determinant = e1.dot(p);
    if (determinant == 0) continue;
    const double u = s.dot(p) / determinant, v = direction.dot(q) / determinant;
    const double along = e2.dot(q) / determinant;
    if (u >= 0 && v >= 0 && u + v <= 1 && along > 1e-9 && along < 1) return true;
  }
  return false;
}

// The formulas of shading.h and of the effects, written down once more.
struct Reference {
  double ambient = 0, strength = 0, exponent = 1, shadow = 0;
  Eigen::Vector3d key_offset_m = Eigen::Vector3d::Zero();  // right, up, towards the eye

  // Light of a pixel; `*steady` is false where a border of a shadow or of a face is near.
  double Light(const geometry::TriangleMesh& mesh, const View& view, double x, double y, bool* in_shadow,
               bool* steady) const {
    const SeenPoint seen = LookAtPixel(mesh, view, x, y);
    const Eigen::Vector3d direction = view.forward + (x - 0.5 * view.width) * view.step * view.right +
                                      (0.5 * view.height - y) * view.step * view.up;
    const Eigen::Vector3d point_m = view.eye_m + seen.depth_m * direction;
    const Eigen::Vector3d a = mesh.Corner(seen.triangle, 0);
    Eigen::Vector3d n =
        (mesh.Corner(seen.triangle, 1) - a).cross(mesh.Corner(seen.triangle, 2) - a).normalized();
    if (n.dot(direction) > 0) n = -n;
    const geometry::Bounds bounds = ComputeBounds(mesh);
    const double radius_m = 0.5 * bounds.DiagonalM();
    const auto lamp = [&](double right, double up, double towards) -> Eigen::Vector3d {
      return bounds.Centre() + right * view.right + up * view.up - towards * view.forward;
    };
    const Eigen::Vector3d key_m = lamp(-3.5 * radius_m + key_offset_m.x(), 4 * radius_m + key_offset_m.y(),
                                       4 * radius_m + key_offset_m.z());
    const Eigen::Vector3d fill_m = lamp(4 * radius_m, -radius_m, 2.5 * radius_m);
    const Eigen::Vector3d to_key = (key_m - point_m).normalized(), to_fill = (fill_m - point_m).normalized();
    const Eigen::Vector3d half = (to_key - direction.normalized()).normalized();
    double key = 0.88 * std::max(0.0, n.dot(to_key));
    if (n.dot(to_key) > 0) key += strength * std::pow(std::max(0.0, n.dot(half)), exponent);
    *in_shadow = Meets(mesh, point_m, key_m, seen.triangle);
    *steady = true;
    for (const double dx : {-1.0, 0.0, 1.0})
      for (const double dy : {-1.0, 0.0, 1.0})
        *steady &= Meets(mesh,
                         point_m + 2e-4 * (dx * view.right + dy * view.up -
                                           2 * n.dot(dx * view.right + dy * view.up) * n),
                         key_m, seen.triangle) == *in_shadow;
    if (*in_shadow) key *= 1 - shadow;
    return 0.07 + ambient + key + 0.26 * std::max(0.0, n.dot(to_fill));
  }
};

struct Counts {
  int object = 0, shadowed = 0;
};
Counts ExpectLight(const EffectLines& lines, const Reference& reference) {
  const geometry::TriangleMesh mesh = StepMesh();
  const PhotoRequest request = RequestOf(MakeSurface("steps", mesh), CameraAt({0.07, -0.2, 0.085}), 90, 90);
  const Photo photo = MustPhotograph(lines, request);
  const View view = MakeView(request.camera, ComputeBounds(mesh), WithAll(90, 90));
  Counts counts;
  for (int i = 0; i < 90 * 90; ++i) {
    const double x = i % 90 + 0.5, y = i / 90 + 0.5;
    if (photo.mask[i] == 0 || !IsSteady(mesh, view, x, y, 0.3, false)) continue;
    bool in_shadow = false, steady = false;
    const double light = reference.Light(mesh, view, x, y, &in_shadow, &steady);
    if (!steady || !IsSteady(mesh, view, x, y, 0.5, true)) continue;
    ++counts.object;
    counts.shadowed += in_shadow;
    EXPECT_NEAR(photo.light[i], light, 2e-4) << x << ' ' << y;
    EXPECT_NEAR(photo.grey[i], 255 * std::min(1.0, light), 0.06);
  }
  EXPECT_GT(counts.object, 1000);
  return counts;
}

TEST(PhotoShading, IsTheDocumentedModelWithoutEffects) {
  ExpectLight({}, Reference());
}

TEST(PhotoShading, AmbientLightIsAddedToEveryPoint) {
  Reference reference;
  reference.ambient = 0.13;
  ExpectLight({{"ambient_light", {"level=0.13"}}}, reference);
  reference.ambient = -0.07;
  ExpectLight({{"ambient_light", {"level=-0.07"}}}, reference);
}

TEST(PhotoShading, LightPositionIsRightUpAndTowardsTheEye) {
  Reference reference;
  reference.key_offset_m = {0.15, -0.1, 0.08};
  ExpectLight({{"light_position", {"offset_mm=150,-100,80"}}}, reference);
}

TEST(PhotoShading, HighlightsAreBlinnAndPhongs) {
  Reference reference;
  reference.strength = 0.6, reference.exponent = 17;
  ExpectLight({{"specular", {"strength=0.6", "exponent=17"}}}, reference);
}

TEST(PhotoShading, ShadowsTakeTheirShareOfTheKeyLightAndItsHighlight) {
  Reference reference;
  reference.shadow = 0.7, reference.strength = 0.3, reference.exponent = 5;
  const Counts counts = ExpectLight(
      {{"cast_shadow", {"strength=0.7"}}, {"specular", {"strength=0.3", "exponent=5"}}}, reference);
  EXPECT_GT(counts.shadowed, 100);
  EXPECT_LT(counts.shadowed, counts.object / 2);
}

TEST(PhotoShading, ShadowsFollowTheLight) {
  Reference reference;
  reference.shadow = 1;
  reference.key_offset_m = {0.3, -0.2, 0};
  ExpectLight({{"light_position", {"offset_mm=300,-200,0"}}, {"cast_shadow", {"strength=1"}}}, reference);
}

// Of an object without hollows.
void ExpectNoShadowOnTheLitSide(geometry::TriangleMesh mesh, const Eigen::Vector3d& centre_m) {
  for (Eigen::Vector3f& vertex_m : mesh.vertices_m) vertex_m += centre_m.cast<float>();
  Camera camera = CameraAt({0.1, -0.3, 0.12});
  camera.eye_m += centre_m, camera.at_m += centre_m;
  const PhotoRequest request = RequestOf(MakeSurface("convex", mesh), camera);
  const Photo lit = MustPhotograph(EffectLines{}, request);
  const Photo shadowed = MustPhotograph({{"cast_shadow", {"strength=1"}}}, request);
  int object = 0, darker = 0;
  for (size_t i = 0; i < lit.grey.size(); ++i) {
    object += lit.mask[i] != 0;
    // What the key light meets at more than 7 deg of grazing. Nearer to the edge of night flat triangles turn away.
    darker += shadowed.grey[i] < lit.grey[i] - 255 * 0.88 * 0.12;
  }
  EXPECT_GT(object, 1500);
  EXPECT_EQ(darker, 0);
}

TEST(PhotoShading, ABallThrowsNoShadowOnItsLitSide) {
  ExpectNoShadowOnTheLitSide(BallMesh(0.07, 60, 90), {0, 0, 0});
}

TEST(PhotoShading, ABallFarFromItsOriginThrowsNoShadowOnItsLitSide) {
  ExpectNoShadowOnTheLitSide(BallMesh(0.07, 60, 90), {3, -2, 1});
}

// Of large triangles single precision knows places least.
TEST(PhotoShading, ABoardThrowsNoShadowOnItsLitSide) {
  geometry::TriangleMesh mesh;
  AddBox({-0.11, -0.015, -0.09}, {0.11, 0.015, 0.09}, &mesh);
  const Eigen::AngleAxisf turn(0.4f, Eigen::Vector3f(0.3f, 0.5f, 0.8f).normalized());
  for (Eigen::Vector3f& vertex_m : mesh.vertices_m) vertex_m = turn * vertex_m;
  ExpectNoShadowOnTheLitSide(mesh, {0, 0, 0});
}

// A micrometre a pixel: a border that lies off by a thousandth of an ordinary pixel, always to the same side, reads as a
// lamp that stands elsewhere in pictures that are many or have little noise.
TEST(PhotoShading, TheBorderOfAShadowLiesWhereTheLampPutsIt) {
  constexpr double kHeightM = 0.02, kPixelM = 1e-6, kDistanceM = 0.2;
  geometry::TriangleMesh mesh;
  AddBox({-0.08, -0.08, -0.01}, {0.08, 0.08, 0}, &mesh);
  AddBox({-0.04, 0.03, -0.001}, {0.06, 0.05, kHeightM}, &mesh);
  const geometry::Bounds bounds = ComputeBounds(mesh);
  // Seen from above, with +y up in the picture, "right" is +x and "towards the eye" +z.
  const Eigen::Vector3d key_m = bounds.Centre() + 0.5 * bounds.DiagonalM() * Eigen::Vector3d(-3.5, 4, 4);
  const double edge_y_m = 0.03;
  const double border_y_m = edge_y_m - kHeightM * (key_m.y() - edge_y_m) / (key_m.z() - kHeightM);
  Camera camera;
  camera.at_m = {0.02, border_y_m, 0};
  camera.eye_m = {0.02, border_y_m, kDistanceM};
  camera.up = Eigen::Vector3d::UnitY();
  PhotoRequest request = RequestOf(MakeSurface("wall", mesh), camera, 100, 100);
  request.lens.fx_px = request.lens.fy_px = kDistanceM / kPixelM;
  const Photo lit = MustPhotograph(EffectLines{}, request);
  const Photo shadowed = MustPhotograph({{"cast_shadow", {"strength=1"}}}, request);
  int darker = 0;
  for (size_t i = 0; i < lit.grey.size(); ++i) darker += shadowed.grey[i] < 0.5f * lit.grey[i];
  EXPECT_NEAR(darker / 100.0, 50, 0.5);
}

TEST(PhotoShading, AFlatTriangleTurnedAwayFromTheLampLiesInItsShadow) {
  const geometry::TriangleMesh mesh = BallMesh(0.07, 24, 36);
  const PhotoRequest request = RequestOf(MakeSurface("ball", mesh), CameraAt({0.1, -0.3, 0.12}), 240, 240);
  const Photo photo = MustPhotograph({{"cast_shadow", {"strength=1"}}}, request);
  const View view = MakeView(request.camera, ComputeBounds(mesh), WithAll(240, 240));
  const double radius_m = 0.5 * ComputeBounds(mesh).DiagonalM();
  const auto lamp = [&](double right, double up, double towards) -> Eigen::Vector3d {
    return radius_m * (right * view.right + up * view.up - towards * view.forward);
  };
  const Eigen::Vector3d key_m = lamp(-3.5, 4, 4), fill_m = lamp(4, -1, 2.5);
  int turned_away = 0;
  for (int i = 0; i < 240 * 240; ++i) {
    const Eigen::Vector3d point_m = photo.point_m[i].cast<double>();
    const Eigen::Vector3d round = point_m.normalized();  // what the shading makes of flat triangles
    const double key = round.dot((key_m - point_m).normalized());
    const double x = i % 240 + 0.5, y = i / 240 + 0.5;
    if (photo.mask[i] == 0 || key < 0.02 || key > 0.2 || !IsSteady(mesh, view, x, y, 0.1, true)) continue;
    const uint32_t t = LookAtPixel(mesh, view, x, y).triangle;
    const Eigen::Vector3d a = mesh.Corner(t, 0);
    const Eigen::Vector3d face = (mesh.Corner(t, 1) - a).cross(mesh.Corner(t, 2) - a);
    if (face.dot(point_m) * face.dot(key_m - point_m) >= 0) continue;
    ++turned_away;
    EXPECT_NEAR(photo.light[i], 0.07 + 0.26 * std::max(0.0, round.dot((fill_m - point_m).normalized())), 0.01)
        << x << ' ' << y;
  }
  EXPECT_GT(turned_away, 10);
}

TEST(PhotoShading, BackgroundLevelIsTheGroundsAlone) {
  const PhotoRequest request = RequestOf(MakeSurface("letter", LetterMesh()), CameraAt({0.12, -0.26, 0.09}));
  const Photo black = MustPhotograph(EffectLines{}, request);
  const Photo photo = MustPhotograph({{"background_level", {"grey=37"}}}, request);
  for (size_t i = 0; i < photo.grey.size(); ++i)
    EXPECT_NEAR(photo.grey[i], black.mask[i] != 0 ? black.grey[i] : 37, 1e-4);
}

}  // namespace
}  // namespace touchstone::image
