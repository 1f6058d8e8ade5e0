// Contact forces of the fingers, a kind of measurement that the product does not have: each finger is a spring that the
// touch presses. Everything that the diagnosis has to know of it stands in ContactForces; server/README.md leads
// through it.
#include <cmath>

#include <gtest/gtest.h>

#include "server/base/numbers/random.h"
#include "server/base/status.h"
#include "server/diagnosis/engine/findings.h"
#include "server/diagnosis/engine/row_modality.h"
#include "server/diagnosis/joint/shared_effects.h"
#include "server/diagnosis/selection/candidates.h"
#include "server/diagnosis/selection/touch_modality.h"
#include "server/diagnosis/touches/predictor.h"
#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis {
namespace {

constexpr double kNewtonsPerMetre = 400,
                 kPressedM = 5e-3;  // of a nominal spring; how far behind the target a touch ends
constexpr double kNoiseN = 0.02;

// Springs that are stiffer than they should be, by a share. No touch and no picture shows it.
std::shared_ptr<const model::Effect> SpringStiffness() {
  static const auto effect = [] {
    auto made = std::make_shared<model::Effect>();
    made->name = "spring_stiffness";
    made->stage = model::Stage::kSensor;
    model::ParameterInfo relative;
    relative.name = "relative";
    relative.lower = -0.5;
    relative.upper = 1;
    relative.typical = 0.1;
    made->parameters.push_back(relative);
    return std::shared_ptr<const model::Effect>(std::move(made));
  }();
  return effect;
}

// Rows are forces in N, one for each finger of each touch, object by object.
class ContactForces : public engine::ObservationModel {
 public:
  ContactForces(touches::Observations observations, const model::Model& real, uint64_t seed)
      : o_(std::move(observations)), predictor_(o_, nullptr), measured_(*Predict(real)) {
    RandomStream random(seed, RandomDomain::kTest);
    for (double& force : measured_) force += kNoiseN * random.Normal();
  }

  int rows() const override { return o_.size() * o_.fingers; }
  const std::vector<std::string>& groups() const override { return o_.objects; }
  int FirstRowOfGroup(int group) const override {
    const auto first = std::lower_bound(o_.object.begin(), o_.object.end(), group);
    return static_cast<int>(first - o_.object.begin()) * o_.fingers;
  }
  int GroupOfRow(int row) const override { return o_.object[row / o_.fingers]; }
  int BlockOfRow(int row) const override { return o_.pose[row / o_.fingers]; }
  double TimeOfRow(int row) const override { return o_.set->session_time_s[o_.row[row / o_.fingers]]; }

  absl::StatusOr<std::vector<double>> Predict(const model::Model& model) const override {
    model::Model touch = model;
    double stiffness = kNewtonsPerMetre;
    for (size_t e = touch.effects.size(); e-- > 0;) {
      if (touch.effects[e].effect->apply) continue;  // what touches know
      if (touch.effects[e].effect->name == "spring_stiffness") stiffness *= 1 + touch.effects[e].values[0];
      touch.effects.erase(touch.effects.begin() + static_cast<long>(e));
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction touched, predictor_.Run(touch, true, false));
    std::vector<double> force(touched.travel_m.size());
    for (size_t i = 0; i < force.size(); ++i) {
      const double standoff_m = o_.set->standoff_m[o_.row[i / o_.fingers]];
      force[i] = stiffness * std::max(standoff_m + kPressedM - touched.travel_m[i], 0.0);  // NaN: misses
    }
    return force;
  }
  Eigen::VectorXd Residual(const std::vector<double>& predicted) const override {
    return Change(predicted, measured_);
  }
  Eigen::VectorXd Change(const std::vector<double>& predicted,
                         const std::vector<double>& moved) const override {
    Eigen::VectorXd change(rows());
    for (int r = 0; r < rows(); ++r) change[r] = moved[r] - predicted[r];
    return change.array().isNaN().select(0, change);
  }

 private:
  touches::Observations o_;
  touches::Predictor predictor_;
  std::vector<double> measured_;
};

// ---- What follows only uses it.

model::Model WithSprings(model::Model model, double relative) {
  if (relative != 0) model.effects.push_back({SpringStiffness(), false, {relative}, {}});
  return model;
}

std::unique_ptr<engine::RowModality> ForcesOf(const touches::HiddenRig& rig, double stiffer) {
  const DiagnosisInput input = touches::MakeTestInput(rig);
  absl::StatusOr<touches::Observations> observations = touches::MakeObservations(input);
  EXPECT_TRUE(observations.ok()) << observations.status();
  engine::RowModality::Description forces;
  forces.name = "contact forces";
  forces.given = *input.model;
  forces.noise = kNoiseN;
  forces.candidates = selection::MakeCandidates(input, *observations);
  forces.candidates.push_back({SpringStiffness()});
  forces.rows = std::make_shared<ContactForces>(
      *observations, WithSprings(touches::WithEffects(*input.model, rig.hidden), stiffer), 7);
  forces.sees = [](const model::Effect& effect) {  // what changes the travel; when a finger reports does not
    return effect.stage == model::Stage::kPose || effect.stage == model::Stage::kContact ||
           effect.name == "spring_stiffness";
  };
  auto made = engine::RowModality::Make(std::move(forces));
  EXPECT_TRUE(made.ok()) << made.status();
  return *std::move(made);
}

engine::Findings FoundAlone(const touches::HiddenRig& rig, double stiffer) {
  const auto forces = ForcesOf(rig, stiffer);
  const absl::StatusOr<engine::Findings> found = engine::FindMissing(*forces, kNoiseN);
  EXPECT_TRUE(found.ok()) << found.status();
  return *found;
}

joint::SharedEffects FoundWithTouches(const touches::HiddenRig& rig) {
  const auto touched = selection::TouchModality::Make(touches::MakeTestInput(rig), {});
  EXPECT_TRUE(touched.ok()) << touched.status();
  const auto forces = ForcesOf(rig, 0);
  absl::StatusOr<joint::SharedEffects> found =
      joint::FindSharedEffects({touched->get(), forces.get()}, forces->given(), {});
  EXPECT_TRUE(found.ok()) << found.status();
  return *std::move(found);
}

TEST(ContactForces, NothingIsMissingWhereNothingIsHidden) {
  const engine::Findings found = FoundAlone({}, 0);
  EXPECT_EQ(found.verdict, engine::Verdict::kAdequate);
  EXPECT_TRUE(found.steps.empty());
  EXPECT_FALSE(found.changed);
}

TEST(ContactForces, StifferSpringsAreFoundAndTheErrorFallsToTheNoise) {
  const engine::Findings found = FoundAlone({}, 0.08);
  EXPECT_EQ(found.verdict, engine::Verdict::kMissingEffects);
  ASSERT_EQ(found.steps.size(), 1u);
  EXPECT_EQ(found.steps[0].effect, "spring_stiffness");
  EXPECT_NEAR(found.steps[0].parameters[0].value, 0.08, 4 * found.steps[0].parameters[0].std_error);
  EXPECT_GT(found.initial.rmse, 3 * kNoiseN);
  EXPECT_NEAR(found.final.rmse, kNoiseN, 0.1 * kNoiseN);
  EXPECT_NEAR(found.final.heldout_rmse, kNoiseN, 0.1 * kNoiseN);
}

TEST(ContactForces, EffectOfTheCatalogueIsFoundInForcesToo) {
  touches::HiddenRig rig;
  rig.hidden = {{"tip_radius", {"radius_mm=1.5"}}};
  const engine::Findings found = FoundAlone(rig, 0);
  ASSERT_EQ(found.steps.size(), 1u);
  EXPECT_EQ(found.steps[0].effect, "tip_radius");
}

TEST(ContactForces, WithTouchesAShiftOfTheObjectsIsOneValueAndTighterThanFromEither) {
  touches::HiddenRig rig;
  rig.hidden = {{"object_pose", {"translation_mm=0.5,-0.4,0.3"}}};
  const joint::SharedEffects found = FoundWithTouches(rig);
  EXPECT_TRUE(found.conflicts.empty());
  ASSERT_EQ(found.steps.size(), 1u);
  EXPECT_EQ(found.steps[0].effect, "object_pose");
  EXPECT_EQ(found.steps[0].shown_by, "both");
  for (const engine::ParameterEstimate& value : found.steps[0].parameters) {
    ASSERT_EQ(value.std_error_alone.size(), 2u) << value.name << value.entry;
    for (const auto& [kind, std_error] : value.std_error_alone) EXPECT_LT(value.std_error, std_error) << kind;
  }
}

// One number over what was tried on both: a cause that only the forces show is seen among the hypotheses of all.
TEST(ContactForces, WithTouchesTheChanceThatNothingIsMissingIsOneNumber) {
  const auto touched = selection::TouchModality::Make(touches::MakeTestInput({}), {});
  ASSERT_TRUE(touched.ok()) << touched.status();
  const auto both = [&](const engine::RowModality& forces) {
    return *engine::NothingMissingOf({touched->get(), &forces});
  };
  const auto nominal = ForcesOf({}, 0), stiffer = ForcesOf({}, 0.08);
  const engine::NothingMissing nothing = both(*nominal), springs = both(*stiffer);
  EXPECT_GT(nothing.p, 0.01);
  EXPECT_EQ(nothing.hypotheses, (*touched)->tried().rows() + nominal->tried().rows());
  EXPECT_LT(springs.p, 1e-6);
  EXPECT_EQ(springs.hypotheses, nothing.hypotheses);
}

TEST(ContactForces, WithTouchesALateSensorIsNoEffectOfBoth) {
  touches::HiddenRig rig;
  rig.hidden = {{"channel_latency", {"latency_us=9000,-4000,-5000"}}};
  EXPECT_TRUE(FoundWithTouches(rig).steps.empty());
}

TEST(ContactForces, ASecondSessionOfTouchesIsAnotherBlockOfTheSameModel) {
  touches::HiddenRig rig;
  rig.hidden = {{"tool_yaw", {"angle_deg=0.6"}}};
  const auto first = selection::TouchModality::Make(touches::MakeTestInput(rig), {});
  rig.seed = 2;
  const auto second = selection::TouchModality::Make(touches::MakeTestInput(rig), {});
  ASSERT_TRUE(first.ok() && second.ok());
  const absl::StatusOr<joint::SharedEffects> found =
      joint::FindSharedEffects({first->get(), second->get()}, (*first)->given(), {});
  ASSERT_TRUE(found.ok()) << found.status();
  ASSERT_EQ(found->steps.size(), 1u);
  EXPECT_EQ(found->steps[0].effect, "tool_yaw");
  const engine::ParameterEstimate& yaw = found->steps[0].parameters[0];
  EXPECT_NEAR(yaw.value, 0.6, 4 * yaw.std_error);
  ASSERT_EQ(yaw.std_error_alone.size(), 2u);
  for (const auto& [session, std_error] : yaw.std_error_alone) EXPECT_LT(yaw.std_error, std_error);
}

}  // namespace
}  // namespace touchstone::diagnosis
