#include "server/diagnosis/report/write_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/report/example_diagnosis.h"

namespace touchstone::diagnosis::report {
namespace {

using engine::Verdict;
using testing::ElementsAre;

TEST(ToReport, GivesTimesInMicroseconds) {
  const v1::Report report = ToReport(ExampleDiagnosis(Verdict::kAdequate));
  EXPECT_DOUBLE_EQ(report.noise_floor_us(), 5000);
  EXPECT_DOUBLE_EQ(report.noise_floor().sigma_us(), 5000);
  EXPECT_DOUBLE_EQ(report.noise_floor().lower_us(), 4800);
  EXPECT_DOUBLE_EQ(report.noise_floor().upper_us(), 5200);
  EXPECT_EQ(report.noise_floor().degrees_of_freedom(), 1440u);
  EXPECT_TRUE(report.noise_floor().from_repeats());
  EXPECT_DOUBLE_EQ(report.initial().rmse_us(), 41000);
  EXPECT_DOUBLE_EQ(report.initial().heldout_rmse_us(), 41100);
  EXPECT_DOUBLE_EQ(report.initial().lack_of_fit_p(), 1e-20);
  EXPECT_DOUBLE_EQ(report.final().rmse_us(), 5000);
  EXPECT_DOUBLE_EQ(report.reducible_share(), 0.985);
}

TEST(ToReport, CountsWhatTookPartAndWhatDidNot) {
  const v1::Report report = ToReport(ExampleDiagnosis(Verdict::kAdequate));
  EXPECT_EQ(report.touches(), 960u);
  EXPECT_THAT(report.fingers(), ElementsAre("l", "m", "r"));
  EXPECT_EQ(report.model_name(), "nominal");
  EXPECT_EQ(report.model_hash(), "354f");
  const v1::DataSummary& data = report.data();
  EXPECT_EQ(data.origin(), "set.csv");
  EXPECT_EQ(data.rows(), 962u);
  ASSERT_EQ(data.unused_size(), 1);
  EXPECT_EQ(data.unused(0).reason(), "at an edge");
  EXPECT_EQ(data.unused(0).rows(), 2u);
  EXPECT_THAT(data.unused(0).examples(), ElementsAre(17u, 45u));
  EXPECT_THAT(data.objects(), ElementsAre("lat00", "lat20"));
  EXPECT_EQ(data.poses(), 240u);
  EXPECT_EQ(data.repeats(), 720u);
  EXPECT_EQ(data.rounds(), 4u);
  EXPECT_THAT(data.speeds_mm_s(), ElementsAre(20));
  EXPECT_EQ(data.missed_contacts(), 3u);
}

TEST(ToReport, HasTheSameVerdict) {
  const std::pair<Verdict, v1::Report::Verdict> verdicts[] = {
      {Verdict::kNone, v1::Report::VERDICT_UNSPECIFIED},
      {Verdict::kAdequate, v1::Report::ADEQUATE},
      {Verdict::kWrongValues, v1::Report::WRONG_VALUES},
      {Verdict::kMissingEffects, v1::Report::MISSING_EFFECTS},
      {Verdict::kUnexplained, v1::Report::UNEXPLAINED},
      {Verdict::kCheckData, v1::Report::CHECK_DATA},
      {Verdict::kTooLittleData, v1::Report::TOO_LITTLE_DATA},
  };
  for (const auto& [verdict, message] : verdicts)
    EXPECT_EQ(ToReport(ExampleDiagnosis(verdict)).verdict(), message);
}

TEST(ToReport, WithoutAStepHasNone) {
  const v1::Report report = ToReport(ExampleDiagnosis(Verdict::kAdequate));
  EXPECT_EQ(report.steps_size(), 0);
  EXPECT_EQ(report.refitted_size(), 0);
  EXPECT_EQ(report.ambiguities_size(), 0);
  EXPECT_FALSE(report.has_unexplained());
  EXPECT_EQ(report.improved_model_yaml(), "");
}

TEST(ToReport, HasAStepWithItsValuesInTheUnitsOfFiles) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kMissingEffects);
  diagnosis.steps = {Step("tip_radius")};
  diagnosis.improved_model_yaml = "touchstone: model/1\n";
  diagnosis.improved_model_hash = "3f9c";
  const v1::Report report = ToReport(diagnosis);
  EXPECT_EQ(report.improved_model_yaml(), "touchstone: model/1\n");
  EXPECT_EQ(report.improved_model_hash(), "3f9c");
  ASSERT_EQ(report.steps_size(), 1);
  const v1::Step& step = report.steps(0);
  EXPECT_EQ(step.effect(), "tip_radius");
  EXPECT_EQ(step.equivalent_size(), 0);
  EXPECT_EQ(step.scope(), "rig");
  EXPECT_DOUBLE_EQ(step.probability(), 0.98);
  EXPECT_DOUBLE_EQ(step.gain_nats(), 1200);
  EXPECT_DOUBLE_EQ(step.rmse_us(), 5000);
  EXPECT_DOUBLE_EQ(step.heldout_rmse_us(), 5030);
  EXPECT_DOUBLE_EQ(step.lack_of_fit_p(), 0.4);
  EXPECT_EQ(step.check_on_rig(), "Measure the tips.");
  ASSERT_EQ(step.parameters_size(), 1);
  const v1::ParameterValue& radius = step.parameters(0);
  EXPECT_EQ(radius.name(), "radius_mm");
  EXPECT_DOUBLE_EQ(radius.value(), 2.98);
  EXPECT_DOUBLE_EQ(radius.std_error(), 0.02);
  EXPECT_DOUBLE_EQ(radius.lower(), 2.94);
  EXPECT_DOUBLE_EQ(radius.upper(), 3.02);
  EXPECT_EQ(radius.unit(), "mm");
  EXPECT_FALSE(radius.has_before());
}

TEST(ToReport, KeepsTheOrderOfStepsAndTheirEquivalents) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kMissingEffects);
  diagnosis.steps = {Step("speed_error"), Step("object_pose")};
  diagnosis.steps[0].equivalent = {"clock_skew", "contact_slowdown"};
  diagnosis.steps[0].discriminating_measurement = "Touch at two speeds.";
  diagnosis.steps[1].scope = engine::EffectScope::kObject;
  diagnosis.steps[1].words = "on lat20 only";
  diagnosis.steps[1].parameters[0].object = "lat20";
  diagnosis.steps[1].parameters[0].entry = "x";
  diagnosis.confounded = {{{"speed_error", "clock_skew", "contact_slowdown"}, "Touch at two speeds."}};
  const v1::Report report = ToReport(diagnosis);
  ASSERT_EQ(report.steps_size(), 2);
  EXPECT_THAT(report.steps(0).equivalent(), ElementsAre("clock_skew", "contact_slowdown"));
  EXPECT_EQ(report.steps(0).discriminating_measurement(), "Touch at two speeds.");
  EXPECT_EQ(report.steps(1).effect(), "object_pose");
  EXPECT_EQ(report.steps(1).scope(), "object");
  EXPECT_EQ(report.steps(1).words(), "on lat20 only");
  EXPECT_EQ(report.steps(1).parameters(0).object(), "lat20");
  EXPECT_EQ(report.steps(1).parameters(0).finger(), "x");
  ASSERT_EQ(report.ambiguities_size(), 1);
  EXPECT_THAT(report.ambiguities(0).effects(), ElementsAre("speed_error", "clock_skew", "contact_slowdown"));
}

TEST(ToReport, GivesARefitWithTheValueBefore) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kWrongValues);
  diagnosis.refitted = {{"tip_radius", {RadiusMm()}}};
  diagnosis.refitted[0].parameters[0].before = 1.5;
  diagnosis.superfluous = {"gravity_sag"};
  const v1::Report report = ToReport(diagnosis);
  ASSERT_EQ(report.refitted_size(), 1);
  EXPECT_EQ(report.refitted(0).effect(), "tip_radius");
  EXPECT_TRUE(report.refitted(0).parameters(0).has_before());
  EXPECT_DOUBLE_EQ(report.refitted(0).parameters(0).before(), 1.5);
  EXPECT_THAT(report.superfluous(), ElementsAre("gravity_sag"));
}

TEST(ToReport, SaysWhyACandidateIsOut) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kMissingEffects);
  engine::RankedCandidate fitted, invisible;
  fitted.effect = "tip_radius";
  fitted.probability = 0.9;
  fitted.rmse = 0.005;
  invisible.effect = "clock_skew";
  invisible.note = engine::CandidateNote::kInvisible;
  diagnosis.candidates = {fitted, invisible};
  const v1::Report report = ToReport(diagnosis);
  ASSERT_EQ(report.candidates_size(), 2);
  EXPECT_EQ(report.candidates(0).note(), "");
  EXPECT_DOUBLE_EQ(report.candidates(0).rmse_us(), 5000);
  EXPECT_EQ(report.candidates(1).note(), "this experiment cannot see it");
}

TEST(ToReport, HasWhatNoEffectExplains) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kUnexplained);
  diagnosis.unexplained.emplace();
  diagnosis.unexplained->covariates = {{"travel_mm", 1e-9, 80}, {"session_time_s", 0.01, 5}};
  diagnosis.unexplained->formula = "k * sin(2*pi*travel_mm/lead)";
  diagnosis.unexplained->formula_yaml = "- formula: {}\n";
  diagnosis.unexplained->lookup_yaml = "- lookup: {}\n";
  diagnosis.unexplained->words = "From touch 480 on finger l travels 0.25 mm farther.";
  diagnosis.unexplained->rmse = 0.007;
  diagnosis.unexplained->heldout_rmse = 0.0075;
  diagnosis.unexplained->heldout_gain = 0.8;
  diagnosis.unexplained->nearest_effect = "gravity_sag";
  diagnosis.unexplained->nearest_cosine = 0.3;
  const v1::Unexplained rest = ToReport(diagnosis).unexplained();
  ASSERT_EQ(rest.covariates_size(), 2);
  EXPECT_EQ(rest.covariates(0).name(), "travel_mm");
  EXPECT_DOUBLE_EQ(rest.covariates(0).p(), 1e-9);
  EXPECT_DOUBLE_EQ(rest.covariates(0).gain_nats(), 80);
  EXPECT_EQ(rest.formula(), "k * sin(2*pi*travel_mm/lead)");
  EXPECT_EQ(rest.formula_yaml(), "- formula: {}\n");
  EXPECT_EQ(rest.lookup_yaml(), "- lookup: {}\n");
  EXPECT_EQ(rest.words(), "From touch 480 on finger l travels 0.25 mm farther.");
  EXPECT_DOUBLE_EQ(rest.rmse_us(), 7000);
  EXPECT_DOUBLE_EQ(rest.heldout_rmse_us(), 7500);
  EXPECT_DOUBLE_EQ(rest.heldout_gain(), 0.8);
  EXPECT_EQ(rest.nearest_effect(), "gravity_sag");
}

TEST(ToReport, HasTheMistakeInTheFileAndItsFix) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kCheckData);
  diagnosis.data_problems = {
      {"finger_order", "l <-> m", "Fingers l and m are swapped.", "touchstone session fix", 0.041, 0.0051}};
  const v1::Report report = ToReport(diagnosis);
  ASSERT_EQ(report.data_problems_size(), 1);
  const v1::DataProblem& problem = report.data_problems(0);
  EXPECT_EQ(problem.kind(), "finger_order");
  EXPECT_EQ(problem.detail(), "l <-> m");
  EXPECT_EQ(problem.words(), "Fingers l and m are swapped.");
  EXPECT_EQ(problem.fix(), "touchstone session fix");
  EXPECT_DOUBLE_EQ(problem.rmse_before_us(), 41000);
  EXPECT_DOUBLE_EQ(problem.rmse_after_us(), 5100);
  EXPECT_EQ(report.steps_size(), 0);
}

TEST(ToReport, SaysHowManyTouchesWouldDo) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kTooLittleData);
  diagnosis.touches_needed = 60;
  EXPECT_EQ(ToReport(diagnosis).touches_needed(), 60u);
}

TEST(ToReport, GivesResidualsInMicrosecondsAndPointsInMillimetres) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kMissingEffects);
  residuals::ErrorSlice slice;
  slice.conditions = "incidence > 12 deg";
  slice.touches = 120;
  slice.mean_residual_s = -0.0091;
  slice.share_of_excess_error = 0.6;
  diagnosis.residuals.slices = {slice};
  diagnosis.residuals.grouped.finger_bias_s = {-0.001, 0.002, -0.001};
  residuals::SurfaceResidual point;
  point.object = "lat20";
  point.contact_m = {0.01, -0.02, 0.03};
  point.residual_s = 0.004;
  diagnosis.residuals.surface_points = {point};
  residuals::WorstTouch worst;
  worst.touch = 17;
  worst.residual_s = {0.02, std::nan(""), -0.02};
  diagnosis.residuals.worst_touches = {worst};
  const v1::Report report = ToReport(diagnosis);
  ASSERT_EQ(report.where_size(), 1);
  EXPECT_EQ(report.where(0).slice(), "incidence > 12 deg");
  EXPECT_DOUBLE_EQ(report.where(0).mean_residual_us(), -9100);
  EXPECT_THAT(report.finger_bias_us(), ElementsAre(-1000, 2000, -1000));
  ASSERT_EQ(report.surface_points_size(), 1);
  EXPECT_DOUBLE_EQ(report.surface_points(0).y_mm(), -20);
  EXPECT_DOUBLE_EQ(report.surface_points(0).residual_us(), 4000);
  ASSERT_EQ(report.worst_touches_size(), 1);
  EXPECT_DOUBLE_EQ(report.worst_touches(0).residual_us(0), 20000);
  EXPECT_TRUE(std::isnan(report.worst_touches(0).residual_us(1)));
}

TEST(ToReport, ProposesTouchesInTheUnitsOfTheProtocol) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kMissingEffects);
  design::ProposedTouch proposed;
  proposed.object = "lat20";
  proposed.touch.target_m = {0.01, 0, 0};
  proposed.touch.speed_m_s = 0.04;
  proposed.touch.session_time_s = 12;
  proposed.purpose = "tells tip_radius from oblique_slip";
  proposed.separation_sigmas = 3.5;
  diagnosis.next_touches = {proposed};
  const v1::Report report = ToReport(diagnosis);
  ASSERT_EQ(report.next_touches_size(), 1);
  EXPECT_EQ(report.next_touches(0).purpose(), "tells tip_radius from oblique_slip");
  EXPECT_DOUBLE_EQ(report.next_touches(0).separation(), 3.5);
  EXPECT_DOUBLE_EQ(report.next_touches(0).touch().target_m().x(), 0.01);
  EXPECT_DOUBLE_EQ(report.next_touches(0).touch().speed_m_s(), 0.04);
  EXPECT_FALSE(report.next_touches(0).touch().has_session_time_s());
}

TEST(ToReport, OfNoTouchesHasNoErrorAndNoFloor) {
  Diagnosis diagnosis;
  diagnosis.verdict = Verdict::kTooLittleData;
  diagnosis.data.fingers = 2;
  diagnosis.warnings = {"No touch could be used."};
  const v1::Report report = ToReport(diagnosis);
  EXPECT_EQ(report.touches(), 0u);
  EXPECT_FALSE(report.has_noise_floor());
  EXPECT_FALSE(report.has_initial());
  EXPECT_FALSE(report.has_final());
  EXPECT_THAT(report.fingers(), ElementsAre("0", "1"));
  EXPECT_THAT(report.warnings(), ElementsAre("No touch could be used."));
}

}  // namespace
}  // namespace touchstone::diagnosis::report
