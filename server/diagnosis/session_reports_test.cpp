// Several sessions of one rig, with a change that is known.
#include <gtest/gtest.h>

#include <cmath>

#include "server/base/numbers/random.h"
#include "server/base/test_tier.h"
#include "server/diagnosis/diagnose.h"
#include "server/diagnosis/report/words/rules.h"
#include "server/diagnosis/report/words/summary.h"
#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis {
namespace {

using engine::Verdict;
using Effects = std::vector<std::pair<std::string, std::vector<std::string>>>;

// A session of the same poses as every other.
touches::HiddenRig SessionRig(uint64_t seed, Effects hidden) {
  touches::HiddenRig rig;
  rig.seed = seed;
  rig.pose_seed = 5;
  rig.hidden = std::move(hidden);
  return rig;
}

std::vector<DiagnosisInput> SessionInputs(const std::vector<touches::HiddenRig>& rigs) {
  std::vector<DiagnosisInput> inputs;
  for (const touches::HiddenRig& rig : rigs) {
    inputs.push_back(touches::MakeTestInput(rig));
    auto set = std::make_shared<session::MeasurementSet>(*inputs.back().set);
    set->origin = "day" + std::to_string(inputs.size()) + ".csv";
    inputs.back().set = set;
  }
  return inputs;
}

report::Diagnosis DiagnoseAll(const std::vector<DiagnosisInput>& inputs) {
  auto found = Diagnose(inputs, {});
  EXPECT_TRUE(found.ok()) << found.status();
  return *std::move(found);
}

std::vector<const joint::ComparedEffect*> ChangedIn(const report::Diagnosis& diagnosis) {
  std::vector<const joint::ComparedEffect*> changed;
  for (const joint::ComparedEffect& effect : diagnosis.sessions->changes->effects)
    if (effect.values == joint::SessionValues::kOwn) changed.push_back(&effect);
  return changed;
}

TEST(Sessions, WhatBothLackIsOneStepAndNoChange) {
  const Effects hidden = {{"tip_radius", {"radius_mm=1.5"}}};
  const std::vector<DiagnosisInput> inputs = SessionInputs({SessionRig(1, hidden), SessionRig(2, hidden)});
  const report::Diagnosis found = DiagnoseAll(inputs);
  EXPECT_EQ(found.verdict, Verdict::kMissingEffects) << found.summary;
  ASSERT_EQ(found.steps.size(), 1u);
  EXPECT_EQ(found.steps[0].effect, "tip_radius");
  EXPECT_NEAR(found.steps[0].parameters[0].value, 1.5, 4 * found.steps[0].parameters[0].std_error);
  EXPECT_TRUE(ChangedIn(found).empty());
  EXPECT_LT(*found.p_nothing_missing, 1e-6);
  EXPECT_GT(found.hypotheses_tried, 200);  // those of both
  ASSERT_EQ(found.data.size(), 2u);
  ASSERT_EQ(found.sessions->same_poses.size(), 1u);
  EXPECT_GT(found.sessions->same_poses[0].measured.p, 0.01);
  // Every error is what a comparison with the saved model finds.
  std::vector<DiagnosisInput> better = inputs;
  for (DiagnosisInput& input : better)
    input.model = std::make_shared<const model::Model>(*found.improved_model);
  const auto compared = Compare(better, {});
  ASSERT_TRUE(compared.ok()) << compared.status();
  for (int s = 0; s < 2; ++s) {
    EXPECT_LT(found.data[s].final->rmse, 0.5 * found.data[s].initial->rmse);
    EXPECT_NEAR(compared->data[s].initial->rmse, found.data[s].final->rmse, 1e-6 * found.data[s].final->rmse);
    EXPECT_DOUBLE_EQ(found.data[s].after_step[0].rmse, found.data[s].final->rmse);
  }
}

TEST(Sessions, AValueThatChangedIsNamedWithBothOfItsValues) {
  const report::Diagnosis found =
      DiagnoseAll(SessionInputs({SessionRig(1, {{"tip_radius", {"radius_mm=1"}}}),
                                 SessionRig(2, {{"tip_radius", {"radius_mm=1.5"}}})}));
  EXPECT_EQ(found.verdict, Verdict::kMissingEffects) << found.summary;
  const auto changed = ChangedIn(found);
  ASSERT_EQ(changed.size(), 1u) << found.summary;
  EXPECT_EQ(changed[0]->effect, "tip_radius");
  const joint::ComparedValue& value = changed[0]->entries[0];
  EXPECT_EQ(value.change, joint::ValueChange::kChanged);
  EXPECT_NEAR(value.difference, 0.5, 4 * value.std_error);
  EXPECT_NEAR(value.by_session[0]->value, 1, 4 * value.by_session[0]->std_error);
  // The step has the value of the last session, as surely as the comparison knows it.
  EXPECT_NEAR(found.steps[0].parameters[0].value, value.by_session[1]->value, value.by_session[1]->std_error);
  EXPECT_NEAR(found.steps[0].parameters[0].std_error / value.by_session[1]->std_error, 1, 0.1);
  EXPECT_LT(found.sessions->same_poses[0].measured.p, 1e-6);
  EXPECT_GT(found.sessions->same_poses[0].left.p, 1e-3);
  EXPECT_NE(found.summary.find("in day1.csv to 1.5"), std::string::npos) << found.summary;
  for (const report::DataReport& data : found.data)
    EXPECT_LT(data.final->rmse, 1.2 * data.noise_floor->sigma);
}

TEST(Sessions, AnObjectThatWasRemountedIsTheOneThatIsNamed) {
  const report::Diagnosis found = DiagnoseAll(
      SessionInputs({SessionRig(1, {}),
                     SessionRig(2, {{"object_pose", {"scope=object", "lat10.translation_mm=0.4,0.3,0"}}})}));
  const auto changed = ChangedIn(found);
  ASSERT_EQ(changed.size(), 1u) << found.summary;
  EXPECT_EQ(changed[0]->effect, "object_pose");
  EXPECT_EQ(changed[0]->object, "lat10");
}

// Times that each pose has for itself, in one session: no value of a model describes that.
TEST(Sessions, AChangeThatNoValueDescribesIsSaidToBeUnexplained) {
  std::vector<DiagnosisInput> inputs = SessionInputs({SessionRig(1, {}), SessionRig(2, {})});
  auto set = std::make_shared<session::MeasurementSet>(*inputs[1].set);
  for (int row = 0; row < set->size(); ++row) {
    RandomStream pose(
        static_cast<uint64_t>(std::llround(1e6 * (set->target_m[row].sum() + set->object[row]))),
        RandomDomain::kTest);
    for (int i = 0; i < 3; ++i) set->time_s[static_cast<size_t>(row) * 3 + i] += 0.003 * pose.Normal();
  }
  inputs[1].set = set;
  const report::Diagnosis found = DiagnoseAll(inputs);
  EXPECT_LT(found.sessions->same_poses[0].left.p, report::kWordsRules.same_poses_p.value());
  EXPECT_EQ(found.verdict, Verdict::kUnexplained) << found.summary;
  EXPECT_NE(found.summary.find("no value of the model describes"), std::string::npos) << found.summary;
}

TEST(Sessions, AMistakeOfOneFileComesBeforeEveryChange) {
  std::vector<DiagnosisInput> inputs = SessionInputs({SessionRig(1, {}), SessionRig(2, {})});
  auto set = std::make_shared<session::MeasurementSet>(*inputs[1].set);
  for (int row = 0; row < set->size(); ++row)
    std::swap(set->time_s[static_cast<size_t>(row) * 3], set->time_s[static_cast<size_t>(row) * 3 + 1]);
  inputs[1].set = set;
  const report::Diagnosis found = DiagnoseAll(inputs);
  EXPECT_EQ(found.verdict, Verdict::kCheckData);
  ASSERT_FALSE(found.data_problems.empty());
  EXPECT_EQ(found.data_problems[0].data_index, 1);
  EXPECT_TRUE(found.steps.empty());
  EXPECT_FALSE(found.sessions->changes);
}

TEST(Sessions, ASessionWithTooFewTouchesTakesNoPart) {
  touches::HiddenRig little = SessionRig(3, {});
  little.objects = {"lat10"};
  little.samples_per_face = 1, little.rounds = 1;
  const report::Diagnosis found = DiagnoseAll(SessionInputs({SessionRig(1, {}), little, SessionRig(2, {})}));
  EXPECT_EQ(found.sessions->taking_part, (std::vector<int>{0, 2}));
  EXPECT_GT(found.data[1].needed, 0);
  EXPECT_EQ(found.verdict, Verdict::kAdequate) << found.summary;
  const report::Diagnosis two = DiagnoseAll(SessionInputs({SessionRig(1, {}), little}));
  EXPECT_EQ(two.verdict, Verdict::kTooLittleData) << two.summary;
}

TEST(Sessions, AMeasurementThatIsGivenTwiceIsRefusedWithBothNames) {
  std::vector<DiagnosisInput> inputs = SessionInputs({SessionRig(1, {}), SessionRig(2, {})});
  // Half of the second day's times are those of the first day.
  auto copy = std::make_shared<session::MeasurementSet>(*inputs[1].set);
  std::copy_n(inputs[0].set->time_s.begin(), copy->time_s.size() / 2, copy->time_s.begin());
  for (const auto& set : {inputs[0].set, std::shared_ptr<const session::MeasurementSet>(copy)}) {
    inputs[1].set = set;
    for (const absl::Status& status : {Diagnose(inputs, {}).status(), Compare(inputs, {}).status()}) {
      EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
      EXPECT_NE(status.message().find("day1.csv"), absl::string_view::npos) << status;
      EXPECT_NE(status.message().find(set->origin), absl::string_view::npos) << status;
    }
  }
}

TEST(Sessions, OtherFingersAreNoSessionOfTheRig) {
  std::vector<DiagnosisInput> inputs = SessionInputs({SessionRig(1, {}), SessionRig(2, {})});
  auto set = std::make_shared<session::MeasurementSet>(*inputs[1].set);
  set->fingers = 2;
  inputs[1].set = set;
  const auto found = Diagnose(inputs, {});
  EXPECT_EQ(found.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(found.status().message().find("day2.csv"), absl::string_view::npos) << found.status();
}

TEST(Sessions, ChangesOfTenStandardErrorsAreFoundAndNothingElse) {
  TOUCHSTONE_SECOND_TIER("statistical: pairs of sessions");
  constexpr int kPairs = 20;
  int found_changed = 0, false_changes = 0, three = 0;
  double std_error = 0;
  const auto pair = [](double radius, uint64_t seed) {
    return DiagnoseAll(
        SessionInputs({SessionRig(2 * seed, {{"tip_radius", {"radius_mm=1.5"}}}),
                       SessionRig(2 * seed + 1, {{"tip_radius", {"radius_mm=" + std::to_string(radius)}}})}));
  };
  for (uint64_t seed = 1; seed <= kPairs; ++seed) {
    const report::Diagnosis same = pair(1.5, seed);
    false_changes += !ChangedIn(same).empty();
    std_error = same.sessions->changes->effects[0].entries[0].std_error;
    const report::Diagnosis ten = pair(1.5 + 10 * std_error, seed + 100);
    const auto changed = ChangedIn(ten);
    found_changed += changed.size() == 1 && changed[0]->effect == "tip_radius";
    false_changes += std::any_of(changed.begin(), changed.end(),
                                 [](const auto* effect) { return effect->effect != "tip_radius"; });
    three += !ChangedIn(pair(1.5 + 3 * std_error, seed + 200)).empty();
  }
  std::printf(
      "standard error of the difference %.3g mm; of %d pairs: 10 standard errors found in %d, 3 in %d; false "
      "%d\n",
      std_error, kPairs, found_changed, three, false_changes);
  EXPECT_EQ(false_changes, 0);
  EXPECT_EQ(found_changed, kPairs);
}

}  // namespace
}  // namespace touchstone::diagnosis
