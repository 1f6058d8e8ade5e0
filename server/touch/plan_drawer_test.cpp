#include "server/touch/plan_drawer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/base/units.h"
#include "server/effects/all_effects.h"
#include "server/geometry/shapes/supershape.h"
#include "server/touch/batch_row.h"

namespace touchstone::touch {
namespace {

using testing::HasSubstr;

using Corners = std::pair<Eigen::Vector3d, Eigen::Vector3d>;  // corners, millimetres

std::shared_ptr<const geometry::Surface> Boxes(const std::vector<Corners>& boxes) {
  geometry::TriangleMesh mesh;
  for (const auto& [low, high] : boxes) {
    const uint32_t first = mesh.vertices_m.size();
    for (int corner = 0; corner < 8; ++corner) {
      Eigen::Vector3d point;
      for (int axis = 0; axis < 3; ++axis) point[axis] = corner >> axis & 1 ? high[axis] : low[axis];
      mesh.vertices_m.push_back((1e-3 * point).cast<float>());
    }
    for (const auto& [a, b, c, d] : {std::array<uint32_t, 4>{0, 2, 3, 1},
                                     {4, 5, 7, 6},
                                     {0, 1, 5, 4},
                                     {2, 6, 7, 3},
                                     {0, 4, 6, 2},
                                     {1, 3, 7, 5}}) {
      mesh.triangles.push_back({first + a, first + b, first + c});
      mesh.triangles.push_back({first + a, first + c, first + d});
    }
  }
  return *geometry::Surface::Create("boxes", mesh);
}

// An L: most of the bounding box is empty.
std::shared_ptr<const geometry::Surface> LShape() {
  return Boxes({{{-75, -75, -75}, {75, 75, -35}}, {{-75, -75, -35}, {-35, 75, 75}}});
}

Plan Faces() {
  Plan plan;
  plan.kind = Plan::Kind::kFaces;
  return plan;
}

std::shared_ptr<const model::Model> WithFingers(int fingers, double spacing_m) {
  return std::make_shared<const model::Model>(model::NominalModel(fingers, spacing_m));
}

TEST(PlanDrawer, HopelessDrawsEndSoonAfterTheyAreCancelled) {
  Plan plan = Faces();
  plan.faces.max_incidence_rad = 0.1 * kRadiansPerDegree;
  plan.faces.max_tilt_rad = kPi / 3;
  PlanDrawer drawer(plan, LShape(), WithFingers(3, 0.03), /*seed=*/1, /*max_draws=*/1'000'000);
  DrawCounts counts;
  int looks = 0;
  const auto drawn = drawer.Draw(0, 0, &counts, [&] { return ++looks == 3; });
  EXPECT_TRUE(absl::IsCancelled(drawn.status())) << drawn.status();
  EXPECT_LT(counts.Draws(), 1000u);
}

TEST(PlanDrawer, EveryTouchOfAnLShapeIsOneThatEveryFingerCompletes) {
  const auto surface = LShape();
  const auto model = WithFingers(3, 0.03);
  const Plan plan = Faces();
  PlanDrawer drawer(plan, surface, model, 7, 1000);
  const TouchSimulator simulator(model);
  DrawCounts counts;
  for (uint64_t number = 0; number < 48; ++number) {
    const auto drawn = drawer.Draw(number, 0, &counts);
    ASSERT_TRUE(drawn.ok()) << drawn.status();
    effects::TouchBatch batch;
    TouchWorkspace workspace;
    simulator.Prepare(1, &batch);
    batch.surface = surface;
    SetTouch(drawn->touch, 0, 0, &batch);
    ASSERT_TRUE(simulator.RunToMotion(&batch, &workspace).ok());
    for (int finger = 0; finger < 3; ++finger) {
      EXPECT_LE(batch.travel_m[finger], plan.faces.standoff_m + plan.faces.stroke_beyond_target_m);
      EXPECT_GE(batch.cos_incidence[finger], std::cos(plan.faces.max_incidence_rad));
    }
    EXPECT_NEAR(batch.travel_m[1], plan.faces.standoff_m, 1e-9) << "the target is on the surface";
  }
  EXPECT_EQ(counts.Of(DrawFlaw::kNone), 48u);
  EXPECT_GT(counts.Draws(), 48u);
}

TEST(PlanDrawer, TheSameNumberGivesTheSameTouchWhateverWasDrawnBefore) {
  const auto surface = LShape();
  const Plan plan = Faces();
  PlanDrawer forth(plan, surface, WithFingers(3, 0.03), 7, 1000);
  PlanDrawer alone(plan, surface, WithFingers(3, 0.03), 7, 1000);
  DrawCounts counts;
  for (uint64_t number = 0; number < 17; ++number) ASSERT_TRUE(forth.Draw(number, 0, &counts).ok());
  const auto a = forth.Draw(17, 0, &counts), b = alone.Draw(17, 0, &counts);
  EXPECT_EQ(a->touch.target_m, b->touch.target_m);
  EXPECT_EQ(a->touch.approach, b->touch.approach);
  // A round later it is the same pose again.
  EXPECT_EQ(alone.Draw(17 + 48, 0, &counts)->touch.lateral, a->touch.lateral);
}

TEST(PlanDrawer, RefusesARodAndSaysWhichConditionFailedHowOften) {
  // A hair: next to no draw lies along it with all three fingers.
  const auto rod = Boxes({{{-100, -0.05, -0.05}, {100, 0.05, 0.05}}});
  const Plan plan = Faces();
  PlanDrawer drawer(plan, rod, WithFingers(3, 0.03), 7, 50);
  DrawCounts counts;
  const auto drawn = drawer.Draw(0, 0, &counts);
  ASSERT_EQ(drawn.status().code(), absl::StatusCode::kFailedPrecondition);
  const std::string words(drawn.status().message());
  EXPECT_THAT(words, HasSubstr("in 50 draws no touch met it"));
  EXPECT_THAT(words, HasSubstr("a finger met nothing"));
  EXPECT_THAT(words, HasSubstr("200 x 0.1 x 0.1 mm"));
  EXPECT_THAT(words, HasSubstr("a higher max_draws"));
  EXPECT_EQ(counts.Draws(), 50u);
}

TEST(PlanDrawer, DoesNotAdviseMoreDrawsForAnObjectThatIsSmallerThanTheHand) {
  const auto pea = Boxes({{{-5, -5, -5}, {5, 5, 5}}});
  PlanDrawer drawer(Faces(), pea, WithFingers(3, 0.03), 7, 50);
  DrawCounts counts;
  const std::string words(drawer.Draw(0, 0, &counts).status().message());
  EXPECT_THAT(words, HasSubstr("The fingers span 60 mm and the object measures 10 x 10 x 10 mm"));
  EXPECT_THAT(words, HasSubstr("a larger object (scale at import) or a narrower end effector"));
  EXPECT_THAT(words, testing::Not(HasSubstr("max_draws")));
}

TEST(PlanDrawer, TheModelDecidesWhereTheFingersAre) {
  const auto surface = Boxes({{{-40, -40, -40}, {40, 40, 40}}});
  const Plan plan = Faces();
  DrawCounts narrow, wide;
  PlanDrawer with_narrow(plan, surface, WithFingers(3, 0.01), 7, 1000);
  PlanDrawer with_wide(plan, surface, WithFingers(3, 0.039), 7, 1000);
  for (uint64_t number = 0; number < 48; ++number) {
    ASSERT_TRUE(with_narrow.Draw(number, 0, &narrow).ok());
    (void)with_wide.Draw(number, 0, &wide);
  }
  EXPECT_GT(wide.Of(DrawFlaw::kFingerMissed), 4 * narrow.Of(DrawFlaw::kFingerMissed));
  // An effect of the model acts too.
  const model::Model nominal = *WithFingers(3, 0.03);
  const auto wider = std::make_shared<const model::Model>(
      *model::AddEffect(nominal, "finger_spacing", {"delta_mm=9"}, effects::Catalogue()));
  DrawCounts with_effect;
  PlanDrawer effect(plan, surface, wider, 7, 1000);
  for (uint64_t number = 0; number < 48; ++number) (void)effect.Draw(number, 0, &with_effect);
  EXPECT_EQ(with_effect.by_flaw, wide.by_flaw);
}

TEST(PlanDrawer, AStartBehindAPartOfTheObjectIsDrawnAgain) {
  // A slit of 20 mm: from a standoff of 60 mm within it a finger on either side would start in the walls.
  const auto slit = Boxes({{{-100, -100, -100}, {-10, 100, 100}},
                           {{10, -100, -100}, {100, 100, 100}},
                           {{-10, -100, -100}, {10, 100, -90}}});
  Plan plan = Faces();
  plan.faces.stroke_beyond_target_m = 1;
  PlanDrawer drawer(plan, slit, WithFingers(3, 0.03), 7, 1000);
  DrawCounts counts;
  for (uint64_t number = 0; number < 48; ++number) ASSERT_TRUE(drawer.Draw(number, 0, &counts).ok());
  EXPECT_GT(counts.Of(DrawFlaw::kStartBlocked), 0u);
}

TEST(PlanDrawer, IncidenceIsBoundedOnASphereWhereThatIsAsked) {
  auto shape = *geometry::NamedSupershape("lat20");
  const auto surface = *geometry::Surface::Create("lat20", *geometry::MakeSupershape(shape, 2000));
  Plan any, square;
  square.sphere.max_incidence_rad = 20 * kRadiansPerDegree;
  DrawCounts of_any, of_square;
  PlanDrawer with_any(any, surface, WithFingers(3, 0.03), 7, 1000);
  PlanDrawer with_square(square, surface, WithFingers(3, 0.03), 7, 1000);
  for (uint64_t number = 0; number < 50; ++number) {
    ASSERT_TRUE(with_any.Draw(number, 0, &of_any).ok());
    ASSERT_TRUE(with_square.Draw(number, 0, &of_square).ok());
  }
  EXPECT_EQ(of_any.Of(DrawFlaw::kSteepIncidence), 0u);
  EXPECT_GT(of_square.Of(DrawFlaw::kSteepIncidence), 0u);
  EXPECT_THAT(of_square.FlawsInWords(square), HasSubstr("an incidence of more than 20 deg"));
}

}  // namespace
}  // namespace touchstone::touch
