// Normalize on plane shapes with shadows and dark sides of their own.
#include <absl/strings/str_cat.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "server/base/numbers/random.h"
#include "server/base/units.h"
#include "server/image/normalize/emulated_photograph.h"
#include "server/image/normalize/normalize.h"

namespace touchstone::image {
namespace {

constexpr int kShapeSidePx = 224;
constexpr double kShapeCentrePx = 105;
constexpr double kGoodShapeIou = 0.97;

// Outlines as radius over direction.
double Radius(int shape, double angle) {
  switch (shape) {
    case 0:
      return 50;
    case 1: {  // a square with round corners
      const double a = angle - 0.3;
      return 45 / std::pow(std::pow(std::cos(a), 6) + std::pow(std::sin(a), 6), 1.0 / 6);
    }
    case 2:  // a star
      return 42 * (1 + 0.25 * std::cos(5 * (angle - 0.2)));
    default: {  // an ellipse
      const double a = angle - 0.8;
      return 60 * 32 / std::hypot(32 * std::cos(a), 60 * std::sin(a));
    }
  }
}

bool Inside(int shape, double x, double y) {
  return std::hypot(x, y) < Radius(shape, std::atan2(y, x));
}

using Light = std::function<double(double x, double y)>;

// The shape lit as `object` on a ground of `ground`, behind a lens and with noise; its mask beside it.
EmulatedPhotograph Photograph(int shape, const Light& object, const Light& ground, const Plane& shadow,
                              double shadow_takes, uint64_t seed) {
  Plane scene(kShapeSidePx, kShapeSidePx);
  EmulatedPhotograph emulated;
  for (int y = 0; y < kShapeSidePx; ++y)
    for (int x = 0; x < kShapeSidePx; ++x) {
      const bool inside = Inside(shape, x - kShapeCentrePx, y - kShapeCentrePx);
      emulated.mask.push_back(inside ? 255 : 0);
      scene.at(x, y) =
          static_cast<float>(inside ? object(x, y) : ground(x, y) * (1 - shadow_takes * shadow.at(x, y)));
    }
  EmulatedPlace place{};
  place.noise_grey = 2;
  place.blur_px = 0.7;
  RandomStream random(seed, RandomDomain::kTest, 0);
  emulated.photograph = RecordedPhotograph({scene}, place, &random);
  return emulated;
}

Plane ShadowOf(int shape, double right, double down, double penumbra_px) {
  Plane shadow(kShapeSidePx, kShapeSidePx);
  for (int y = 0; y < kShapeSidePx; ++y)
    for (int x = 0; x < kShapeSidePx; ++x)
      shadow.at(x, y) = Inside(shape, x - kShapeCentrePx - right, y - kShapeCentrePx - down) ? 1.0f : 0.0f;
  return penumbra_px > 0 ? Blurred(shadow, static_cast<float>(penumbra_px)) : shadow;
}

double IouOf(const EmulatedPhotograph& emulated) {
  const auto normalized = Normalize(emulated.photograph);
  EXPECT_TRUE(normalized.ok()) << normalized.status();
  return normalized.ok() ? MaskIou(normalized->mask, emulated.mask) : 0;
}

// A dark object on bright paper; its shadow takes 40 to 60 % of the light and has a penumbra of 0 to 4 px.
TEST(NormalizeShadow, OfADarkObjectOnPaperIsNotPartOfIt) {
  int good = 0, all = 0;
  for (int shape = 0; shape < 4; ++shape)
    for (const double takes : {0.4, 0.6})
      for (const double penumbra_px : {0.0, 2.0, 3.0, 4.0}) {
        RandomStream random(++all, RandomDomain::kTest, 1);
        const double length = random.Uniform(8, 28), angle = random.Uniform(0, 2 * kPi);
        const double tilt = random.Uniform(0, 2 * kPi);
        const auto paper = [tilt](double x, double y) {
          return 215 * (1 + 0.1 * ((x - 112) * std::cos(tilt) + (y - 112) * std::sin(tilt)) / 112);
        };
        const auto dark = [](double x, double) { return 45 + 0.24 * (x - kShapeCentrePx); };
        const double iou = IouOf(Photograph(
            shape, dark, paper,
            ShadowOf(shape, length * std::cos(angle), length * std::sin(angle), penumbra_px), takes, all));
        good += iou >= kGoodShapeIou;
        if (iou < kGoodShapeIou)
          std::printf("shape %d, shadow takes %.0f %%, penumbra %.0f px: IoU %.3f\n", shape, 100 * takes,
                      penumbra_px, iou);
      }
  ASSERT_EQ(all, 32);
  EXPECT_GE(good, 30);
}

TEST(NormalizeShadow, AWhiteObjectOnGreyKeepsItsDarkSide) {
  const auto grey = [](double, double) { return 110.0; };
  // Shaded as a ball is, and as three faces of a box are.
  const auto ball = [](double x, double y) {
    return 235 * std::clamp(0.55 - 0.5 * (x + y - 2 * kShapeCentrePx) / 90, 0.22, 1.0);
  };
  const auto faces = [](double x, double y) {
    return (x - kShapeCentrePx) + (y - kShapeCentrePx) < 8 ? 220.0 : x - y > 5 ? 150.0 : 62.0;
  };
  for (int shape = 0; shape < 4; ++shape) {
    EXPECT_GE(IouOf(Photograph(shape, ball, grey, Plane(kShapeSidePx, kShapeSidePx), 0, shape)),
              kGoodShapeIou)
        << "ball " << shape;
    // The star's dark face ends in its notches, where no outline goes on.
    if (shape == 2) continue;
    EXPECT_GE(IouOf(Photograph(shape, faces, grey, Plane(kShapeSidePx, kShapeSidePx), 0, shape)),
              kGoodShapeIou)
        << "faces " << shape;
  }
}

TEST(NormalizeShadow, ABrightDiscOnAPlainGroundIsAnObject) {
  for (const auto& [ground, disc] : {std::pair<double, double>{128, 235}, {40, 200}, {90, 160}, {200, 250}})
    EXPECT_GE(
        IouOf(Photograph(
            0, [disc = disc](double, double) { return disc; },
            [ground = ground](double, double) { return ground; }, Plane(kShapeSidePx, kShapeSidePx), 0, 1)),
        kGoodShapeIou)
        << disc << " on " << ground;
}

}  // namespace
}  // namespace touchstone::image
