// How sure a fitted model's predictions are: what a report says of that, against touches of the same rig that
// no fit has seen.
#include "server/diagnosis/answers/uncertainty_reports.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "server/base/numbers/normal.h"
#include "server/base/test_tier.h"
#include "server/diagnosis/diagnose.h"
#include "server/diagnosis/touches/simulated_test_set.h"
#include "server/diagnosis/touches/time_uncertainties.h"
#include "server/model/value_names.h"
#include "server/uncertainty/posterior_message.h"

namespace touchstone::diagnosis {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

touches::HiddenRig RigWithTips(uint64_t seed = 1) {
  touches::HiddenRig rig;
  rig.hidden = {{"tip_radius", {"radius_mm=1.5"}}};
  rig.seed = seed;
  return rig;
}

report::Diagnosis Diagnosed(const DiagnosisInput& input) {
  const absl::StatusOr<report::Diagnosis> diagnosis = Diagnose(input, {});
  EXPECT_TRUE(diagnosis.ok()) << diagnosis.status();
  return diagnosis.ok() ? *diagnosis : report::Diagnosis();
}

// Of contact times on poses that were never touched, less the mean over their touch, over their standard
// uncertainty. The surfaces are those of the rig.
std::vector<double> StandardisedErrors(const touches::HiddenRig& rig,
                                       const uncertainty::Posterior& posterior) {
  touches::HiddenRig others = rig;
  others.pose_seed = rig.seed + 1000;
  DiagnosisInput input = touches::MakeTestInput(others);
  input.model = std::make_shared<const model::Model>(posterior.model);
  const touches::Observations observations = *touches::MakeObservations(input);
  const touches::Predictor predictor(observations, nullptr);
  const touches::Prediction prediction = *predictor.Run(posterior.model, true, false);
  const uncertainty::PredictedTimes times(std::make_shared<const uncertainty::Posterior>(posterior));
  const auto found = touches::UncertaintyOf(predictor, prediction, times);
  EXPECT_TRUE(found.ok()) << found.status();
  const std::vector<double> errors = touches::Residuals(observations, prediction);
  std::vector<double> standardised;
  for (size_t e = 0; e < errors.size(); ++e)
    if (!std::isnan(found->combined_s[e]) && !std::isnan(errors[e]))
      standardised.push_back(errors[e] / found->combined_s[e]);
  return standardised;
}

// Of 95 % intervals, the share that holds the time that was measured.
double Coverage(const std::vector<double>& standardised) {
  double held = 0;
  for (const double z : standardised) held += std::abs(z) < kNormalQuantile975;
  return held / static_cast<double>(standardised.size());
}

TEST(Posterior, IsOfTheModelThatIsSaved) {
  const report::Diagnosis report = Diagnosed(touches::MakeTestInput(RigWithTips()));
  ASSERT_TRUE(report.posterior && report.improved_model) << report.summary;
  const v1::ModelPosterior message = uncertainty::ToMessage(*report.posterior);
  EXPECT_EQ(message.model_hash(), report.improved_model->Hash());
  EXPECT_EQ(message.model_yaml(), model::FormatModel(*report.improved_model));
  const model::Model saved =
      *model::ParseModel(model::FormatModel(*report.improved_model), "better.yaml", effects::Catalogue());
  ASSERT_EQ(message.values_size(), 1);
  const v1::PosteriorValue& radius = message.values(0);
  const model::EffectInstance& effect = saved.effects[radius.effect_index()];
  EXPECT_EQ(radius.effect(), effect.effect->name);
  EXPECT_EQ(radius.parameter(), "radius_mm");
  EXPECT_DOUBLE_EQ(radius.value() * 1e-3, effect.values[0]);
  // As sure as the step says: what rigs show adds next to nothing to what the touches do.
  EXPECT_NEAR(radius.std_error(), report.steps[0].parameters[0].std_error, 0.01 * radius.std_error());
  EXPECT_NEAR(report.posterior->repeatability_s * 1e6, report.data[0].noise_floor->sigma, 1e-6);
  EXPECT_TRUE(uncertainty::FromMessage(message).ok());
}

TEST(Posterior, AValueAtItsBoundIsSaid) {
  const DiagnosisInput input = touches::MakeTestInput(RigWithTips());
  uncertainty::Posterior posterior = *Diagnosed(input).posterior;
  EXPECT_THAT(Uncertainty(input, posterior, {})->warnings, testing::Each(Not(HasSubstr("bound"))));
  posterior.SetValue(0, posterior.Upper(0), &posterior.model);
  posterior.covariance.setZero();
  EXPECT_THAT(
      Uncertainty(input, posterior, {})->warnings,
      testing::Contains(AllOf(HasSubstr("tip_radius.radius_mm = "), HasSubstr("at a bound of its range"))));
}

// A finger that stands elsewhere on some touches is no effect of the catalogue.
TEST(Posterior, AMisfitThatTheModelLeavesIsInTheBudget) {
  DiagnosisInput input = touches::MakeTestInput(RigWithTips());
  const report::Diagnosis fits = Diagnosed(input);
  const auto misfit = [](const report::Diagnosis& report) -> const uncertainty::Contribution* {
    const auto& all = report.uncertainty.back().contributions;
    const auto found =
        std::find_if(all.begin(), all.end(), [](const auto& one) { return one.name == "misfit"; });
    return found == all.end() ? nullptr : &*found;
  };
  EXPECT_EQ(misfit(fits), nullptr);
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  std::map<std::array<double, 3>, double> jump_s;  // the same for the repeats of a pose
  for (int row = 0; row < set->size(); ++row) {
    const Eigen::Vector3d& at = set->target_m[row];
    const auto [jump, is_new] = jump_s.try_emplace({at.x(), at.y(), at.z()}, 0);
    if (is_new) jump->second = jump_s.size() % 2 == 0 ? 0.02 : -0.02;
    set->time_s[static_cast<size_t>(row) * set->fingers + 1] += jump->second;
  }
  input.set = set;
  const report::Diagnosis left = Diagnosed(input);
  const uncertainty::Budget& all = left.uncertainty.back();
  ASSERT_NE(misfit(left), nullptr) << left.summary;
  double shares = 0, squares = 0;
  for (const uncertainty::Contribution& one : all.contributions) {
    EXPECT_LE(one.share, all.contributions[0].share);
    shares += one.share, squares += one.std_uncertainty * one.std_uncertainty;
  }
  EXPECT_NEAR(shares, 1, 0.02);
  EXPECT_NEAR(std::sqrt(squares) / all.combined, 1, 0.01);
  // Of a finger less the mean over three.
  const double error = left.data[0].final->rmse;
  EXPECT_NEAR(all.combined, error * std::sqrt(2.0 / 3), 0.01 * error);
}

TEST(Posterior, OpensValuesThatTheSearchHasLeftAlone) {
  touches::HiddenRig rig = RigWithTips();
  rig.known = rig.hidden;
  const report::Diagnosis report = Diagnosed(touches::MakeTestInput(rig));
  EXPECT_EQ(report.verdict, engine::Verdict::kAdequate) << report.summary;
  ASSERT_TRUE(report.posterior);
  EXPECT_EQ(report.posterior->model.Hash(), touches::MakeTestInput(rig).model->Hash());
  ASSERT_EQ(report.posterior->values.size(), 1u);
  EXPECT_GT(report.posterior->StdError(0), 1e-6);
  EXPECT_LT(report.posterior->StdError(0), 1e-4);
}

TEST(Posterior, CoversTimesOfPosesThatWereNeverTouched) {
  const touches::HiddenRig rig = RigWithTips();
  const report::Diagnosis report = Diagnosed(touches::MakeTestInput(rig));
  ASSERT_TRUE(report.posterior);
  const std::vector<double> errors = StandardisedErrors(rig, *report.posterior);
  EXPECT_GT(errors.size(), 150u);
  EXPECT_GT(Coverage(errors), 0.90);
  EXPECT_LT(Coverage(errors), 0.99);
}

TEST(Posterior, CoversTimesInNinetyTwoToNinetyEightPercentOfManySets) {
  TOUCHSTONE_SECOND_TIER("statistical: 60 sets with hidden effects, half of them with bad surfaces");
  const std::pair<std::string, std::vector<std::string>> hidden[] = {{"tip_radius", {"radius_mm=1.5"}},
                                                                     {"speed_error", {"relative=0.05"}},
                                                                     {"oblique_slip", {"travel_mm=1"}}};
  for (const bool bumpy : {false, true}) {
    std::vector<double> all;
    for (uint64_t seed = 1; seed <= 30; ++seed) {
      touches::HiddenRig rig;
      rig.seed = seed;
      rig.hidden = {hidden[seed % 3]};
      if (bumpy) rig.hidden.push_back({"surface_error", {"rms_mm=0.2", "length_mm=30"}});
      const report::Diagnosis report = Diagnosed(touches::MakeTestInput(rig));
      ASSERT_TRUE(report.posterior) << seed;
      const std::vector<double> errors = StandardisedErrors(rig, *report.posterior);
      all.insert(all.end(), errors.begin(), errors.end());
    }
    std::printf("%s: %zu contact times, coverage %.4f\n", bumpy ? "bad surfaces" : "good surfaces",
                all.size(), Coverage(all));
    EXPECT_GT(Coverage(all), 0.92) << bumpy;
    EXPECT_LT(Coverage(all), 0.98) << bumpy;
  }
}

TEST(UncertaintyOfPlan, IsThatOfTheReportOnItsOwnTouches) {
  const DiagnosisInput input = touches::MakeTestInput(RigWithTips());
  const report::Diagnosis report = Diagnosed(input);
  ASSERT_TRUE(report.posterior);
  ASSERT_EQ(report.uncertainty.size(), 4u);  // three objects, and all
  const absl::StatusOr<report::Diagnosis> plan = Uncertainty(input, *report.posterior, {});
  ASSERT_TRUE(plan.ok()) << plan.status();
  // Touches at an edge are left out of both, those that the report set aside of it alone.
  EXPECT_GE(plan->uncertainty.back().touches, report.uncertainty.back().touches);
  EXPECT_LE(plan->uncertainty.back().touches, report.uncertainty.back().touches + 3);
  EXPECT_NEAR(plan->uncertainty.back().combined, report.uncertainty.back().combined,
              0.05 * report.uncertainty.back().combined);
  EXPECT_THAT(plan->warnings.back(), HasSubstr("an edge"));
  EXPECT_EQ(plan->verdict, engine::Verdict::kNone);
  EXPECT_GT(plan->data[0].surface_points.size(), 0u);
  EXPECT_GT(plan->data[0].surface_points[0].std_uncertainty_s, 0);
  EXPECT_EQ(report.uncertainty.back().beyond_measured, 0);
}

TEST(UncertaintyOfPlan, WarnsOfObjectsThatWereNotMeasured) {
  const report::Diagnosis report = Diagnosed(touches::MakeTestInput(RigWithTips()));
  touches::HiddenRig others;
  others.objects = {"lat15"};
  const absl::StatusOr<report::Diagnosis> plan =
      Uncertainty(touches::MakeTestInput(others), *report.posterior, {});
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->uncertainty[0].beyond_measured, plan->uncertainty[0].touches);
  EXPECT_THAT(plan->warnings[0], HasSubstr("lat15 was not measured"));
}

TEST(Posterior, OfSeveralSessionsKnowsWhatDiffersBetweenThem) {
  std::vector<DiagnosisInput> sessions;
  for (const char* radius : {"radius_mm=1.2", "radius_mm=1.5", "radius_mm=1.8"}) {
    touches::HiddenRig rig = RigWithTips(sessions.size() + 1);
    rig.hidden = {{"tip_radius", {radius}}};
    sessions.push_back(touches::MakeTestInput(rig));
    // Sessions of one rig have one file each.
    auto set = std::make_shared<session::MeasurementSet>(*sessions.back().set);
    set->origin = std::string(radius) + ".csv";
    sessions.back().set = set;
  }
  const absl::StatusOr<report::Diagnosis> report = Diagnose(sessions, {});
  ASSERT_TRUE(report.ok()) << report.status();
  ASSERT_TRUE(report->posterior) << report->summary;
  EXPECT_EQ(report->posterior->model.Hash(), report->improved_model->Hash());
  ASSERT_TRUE(report->posterior->values[0].between_sessions);
  EXPECT_NEAR(*report->posterior->values[0].between_sessions, 3e-4, 1e-4);
  ASSERT_TRUE(report->uncertainty.back().reproducibility);
  EXPECT_GT(*report->uncertainty.back().reproducibility, report->uncertainty.back().parameters);
}

TEST(Posterior, OfPhotographsOrMistakenSetsIsNone) {
  DiagnosisInput swapped = touches::MakeTestInput(RigWithTips());
  auto set = std::make_shared<session::MeasurementSet>(*swapped.set);
  for (size_t k = 0; k + 2 < set->time_s.size(); k += 3) std::swap(set->time_s[k], set->time_s[k + 1]);
  swapped.set = set;
  const report::Diagnosis report = Diagnosed(swapped);
  EXPECT_EQ(report.verdict, engine::Verdict::kCheckData) << report.summary;
  EXPECT_FALSE(report.posterior);
  EXPECT_TRUE(report.uncertainty.empty());
}

}  // namespace
}  // namespace touchstone::diagnosis
