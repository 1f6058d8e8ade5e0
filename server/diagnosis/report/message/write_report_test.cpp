#include "server/diagnosis/report/message/write_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/report/kinds/example_diagnosis.h"
#include "server/model/provenance.h"

namespace touchstone::diagnosis::report {
namespace {

using engine::Verdict;
using testing::ElementsAre;
using testing::StartsWith;

TEST(ToReport, GivesTimesInMicroseconds) {
  const v1::Report report = ToReport(ExampleDiagnosis(Verdict::kAdequate));
  ASSERT_EQ(report.data_size(), 1);
  const v1::DataReport& data = report.data(0);
  EXPECT_EQ(data.kind(), v1::DataReport::TOUCHES);
  EXPECT_EQ(data.unit(), "us");
  EXPECT_DOUBLE_EQ(data.noise_floor(), 5000);
  EXPECT_DOUBLE_EQ(data.noise().lower(), 4800);
  EXPECT_DOUBLE_EQ(data.noise().upper(), 5200);
  EXPECT_EQ(data.noise().degrees_of_freedom(), 1440u);
  EXPECT_TRUE(data.noise().from_repeats());
  EXPECT_DOUBLE_EQ(data.initial().rmse(), 41000);
  EXPECT_DOUBLE_EQ(data.initial().heldout_rmse(), 41100);
  EXPECT_DOUBLE_EQ(data.initial().lack_of_fit_p(), 1e-20);
  EXPECT_DOUBLE_EQ(data.final().rmse(), 5000);
  EXPECT_DOUBLE_EQ(data.reducible_share(), 0.985);
}

TEST(ToReport, CountsWhatTookPartAndWhatDidNot) {
  const v1::Report report = ToReport(ExampleDiagnosis(Verdict::kAdequate));
  EXPECT_EQ(report.model_name(), "nominal");
  EXPECT_EQ(report.model_hash(), "354f");
  EXPECT_EQ(report.data(0).count(), 960u);
  EXPECT_EQ(report.data(0).session(), "set.csv");
  EXPECT_FALSE(report.data(0).emulated());
  EXPECT_THAT(report.data(0).fingers(), ElementsAre("l", "m", "r"));
  const v1::SetAside& set_aside = report.data(0).set_aside();
  EXPECT_EQ(set_aside.count(), 2u);
  EXPECT_EQ(set_aside.words(), "2: at an edge");
  ASSERT_EQ(set_aside.rows_size(), 1);
  EXPECT_EQ(set_aside.rows(0).reason(), "at an edge");
  EXPECT_EQ(set_aside.rows(0).rows(), 2u);
  EXPECT_THAT(set_aside.rows(0).examples(), ElementsAre(17u, 45u));
  const v1::DataSummary& data = report.data(0).set();
  EXPECT_EQ(data.rows(), 962u);
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
  EXPECT_FALSE(report.data(0).has_unexplained());
  EXPECT_EQ(report.data(0).after_step_size(), 0);
  EXPECT_EQ(report.improved_model_yaml(), "");
}

TEST(ToReport, EveryModelSaysWhatItWasFittedTo) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kUnexplained);
  diagnosis.improved_model.emplace();
  DataReport& data = diagnosis.data[0];
  data.content_sha256 = "0f3a";
  data.unexplained.emplace();
  data.unexplained->model_with.emplace();
  data.unexplained->rmse = 1234;
  const v1::Report report = ToReport(diagnosis);
  const auto said = [](const std::string& yaml) { return *model::ReadProvenance(yaml, "model"); };
  const model::Provenance improved = said(report.improved_model_yaml());
  EXPECT_EQ(improved.over_hash, diagnosis.model_hash);
  ASSERT_EQ(improved.fitted_to.size(), 1u);
  EXPECT_EQ(improved.fitted_to[0].set, data.session);
  EXPECT_EQ(improved.fitted_to[0].sha256, "0f3a");
  EXPECT_EQ(improved.fitted_to[0].unit, "us");
  EXPECT_EQ(improved.fitted_to[0].rmse_before, data.initial->rmse);
  EXPECT_EQ(improved.fitted_to[0].rmse_after, data.final->rmse);
  EXPECT_EQ(said(report.data(0).unexplained().model_yaml()).fitted_to[0].rmse_after, 1234);
  // A session that took no part was not fitted to.
  diagnosis.data.push_back(data);
  diagnosis.data[1].needed = 40;
  EXPECT_EQ(said(ToReport(diagnosis).improved_model_yaml()).fitted_to.size(), 1u);
}

TEST(ToReport, HasAStepWithItsValuesInTheUnitsOfFiles) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kMissingEffects);
  diagnosis.steps = {ExampleStep("tip_radius")};
  diagnosis.data[0].after_step = {{5000, 5030, 0.4}};
  diagnosis.improved_model.emplace();
  diagnosis.improved_model->name = "better";
  const v1::Report report = ToReport(diagnosis);
  EXPECT_THAT(report.improved_model_yaml(), StartsWith(model::FormatModel(*diagnosis.improved_model)));
  EXPECT_EQ(report.improved_model_hash(), diagnosis.improved_model->Hash());
  ASSERT_EQ(report.steps_size(), 1);
  const v1::Step& step = report.steps(0);
  EXPECT_EQ(step.effect(), "tip_radius");
  EXPECT_EQ(step.equivalent_size(), 0);
  EXPECT_EQ(step.scope().kind(), v1::Scope::RIG);
  EXPECT_EQ(step.scope().objects_size(), 0);
  EXPECT_EQ(step.shown_by_size(), 0);
  EXPECT_DOUBLE_EQ(step.probability(), 0.98);
  EXPECT_DOUBLE_EQ(step.gain_nats(), 1200);
  ASSERT_EQ(report.data(0).after_step_size(), 1);
  const v1::Quality& after = report.data(0).after_step(0);
  EXPECT_DOUBLE_EQ(after.rmse(), 5000);
  EXPECT_DOUBLE_EQ(after.heldout_rmse(), 5030);
  EXPECT_DOUBLE_EQ(after.lack_of_fit_p(), 0.4);
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
  diagnosis.steps = {ExampleStep("speed_error"), ExampleStep("object_pose")};
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
  EXPECT_EQ(report.steps(1).scope().kind(), v1::Scope::OBJECT);
  EXPECT_THAT(report.steps(1).scope().objects(), ElementsAre("lat20"));
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
  Candidate fitted, invisible;
  fitted.effect = "tip_radius";
  fitted.probability = 0.9;
  fitted.rmse = 5000;
  invisible.effect = "clock_skew";
  invisible.note = engine::CandidateNote::kInvisible;
  diagnosis.data[0].candidates = {fitted, invisible};
  const v1::DataReport data = ToReport(diagnosis).data(0);
  ASSERT_EQ(data.candidates_size(), 2);
  EXPECT_EQ(data.candidates(0).note(), "");
  EXPECT_DOUBLE_EQ(data.candidates(0).rmse(), 5000);
  EXPECT_EQ(data.candidates(1).note(), "this experiment cannot see it");
}

TEST(ToReport, HasWhatNoEffectExplains) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kUnexplained);
  Unexplained& given = diagnosis.data[0].unexplained.emplace();
  given.covariates = {{"travel_mm", 1e-9, 80}, {"session_time_s", 0.01, 5}};
  given.formula = "k * sin(2*pi*travel_mm/lead)";
  given.formula_yaml = "- formula: {}\n";
  given.lookup_yaml = "- lookup: {}\n";
  given.words = "From touch 480 on finger l travels 0.25 mm farther.";
  given.rmse = 7000;
  given.heldout_rmse = 7500;
  given.heldout_gain = 0.8;
  given.nearest_effect = "gravity_sag";
  given.nearest_cosine = 0.3;
  const v1::Unexplained rest = ToReport(diagnosis).data(0).unexplained();
  ASSERT_EQ(rest.covariates_size(), 2);
  EXPECT_EQ(rest.covariates(0).name(), "travel_mm");
  EXPECT_DOUBLE_EQ(rest.covariates(0).p(), 1e-9);
  EXPECT_DOUBLE_EQ(rest.covariates(0).gain_nats(), 80);
  EXPECT_EQ(rest.formula(), "k * sin(2*pi*travel_mm/lead)");
  EXPECT_EQ(rest.formula_yaml(), "- formula: {}\n");
  EXPECT_EQ(rest.lookup_yaml(), "- lookup: {}\n");
  EXPECT_EQ(rest.words(), "From touch 480 on finger l travels 0.25 mm farther.");
  EXPECT_DOUBLE_EQ(rest.rmse(), 7000);
  EXPECT_DOUBLE_EQ(rest.heldout_rmse(), 7500);
  EXPECT_DOUBLE_EQ(rest.heldout_gain(), 0.8);
  EXPECT_EQ(rest.nearest_effect(), "gravity_sag");
}

TEST(ToReport, HasTheMistakeInTheFileAndItsFix) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kCheckData);
  diagnosis.data_problems = {{engine::ProblemKind::kFingerOrder, "l <-> m", "Fingers l and m are swapped.",
                              "touchstone session fix", 41000, 5100}};
  const v1::Report report = ToReport(diagnosis);
  ASSERT_EQ(report.data_problems_size(), 1);
  const v1::DataProblem& problem = report.data_problems(0);
  EXPECT_EQ(problem.kind(), v1::DataProblem::FINGER_ORDER);
  EXPECT_EQ(problem.detail(), "l <-> m");
  EXPECT_EQ(problem.words(), "Fingers l and m are swapped.");
  EXPECT_EQ(problem.fix(), "touchstone session fix");
  EXPECT_DOUBLE_EQ(problem.error_before(), 41000);
  EXPECT_DOUBLE_EQ(problem.error_after(), 5100);
  EXPECT_EQ(problem.data_index(), 0u);
  EXPECT_EQ(report.steps_size(), 0);
}

TEST(ToReport, NamesEveryKindOfMistakeByItsName) {
  using engine::ProblemKind;
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kCheckData);
  const std::pair<ProblemKind, const char*> kinds[] = {{ProblemKind::kFingerOrder, "FINGER_ORDER"},
                                                       {ProblemKind::kFrame, "FRAME"},
                                                       {ProblemKind::kDuplicates, "DUPLICATES"},
                                                       {ProblemKind::kStaleRows, "STALE_ROWS"},
                                                       {ProblemKind::kMirrored, "MIRRORED"},
                                                       {ProblemKind::kWrongObject, "WRONG_OBJECT"},
                                                       {ProblemKind::kSaturatedTimes, "SATURATED_TIMES"}};
  for (const auto& [kind, name] : kinds) {
    diagnosis.data_problems = {{kind, "", "", "", 0, 0}};
    EXPECT_EQ(v1::DataProblem::Kind_Name(ToReport(diagnosis).data_problems(0).kind()), name);
  }
}

TEST(ToReport, SaysHowManyTouchesWouldDo) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kTooLittleData);
  diagnosis.data[0].needed = 60;
  EXPECT_EQ(ToReport(diagnosis).data(0).needed(), 60u);
}

TEST(ToReport, GivesResidualsInMicrosecondsAndPointsInMillimetres) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kMissingEffects);
  residuals::ErrorSlice slice;
  slice.conditions = "incidence > 12 deg";
  slice.touches = 120;
  slice.mean_residual_s = -0.0091;
  slice.share_of_excess_error = 0.6;
  residuals::ResidualSummary residuals;
  residuals.slices = {slice};
  residuals.grouped.finger_bias_s = {-0.001, 0.002, -0.001};
  residuals::SurfaceResidual point;
  point.object = "lat20";
  point.contact_m = {0.01, -0.02, 0.03};
  point.residual_s = 0.004;
  residuals.surface_points = {point};
  residuals::WorstTouch worst;
  worst.touch = 17;
  worst.residual_s = {0.02, std::nan(""), -0.02};
  residuals.worst_touches = {worst};
  AddResiduals(residuals, &diagnosis.data[0]);
  const v1::DataReport data = ToReport(diagnosis).data(0);
  ASSERT_EQ(data.where_size(), 1);
  EXPECT_EQ(data.where(0).count(), 120u);
  EXPECT_EQ(data.where(0).slice(), "incidence > 12 deg");
  EXPECT_DOUBLE_EQ(data.where(0).mean_residual(), -9100);
  EXPECT_THAT(data.finger_bias(), ElementsAre(-1000, 2000, -1000));
  ASSERT_EQ(data.surface_points_size(), 1);
  EXPECT_DOUBLE_EQ(data.surface_points(0).y_mm(), -20);
  EXPECT_DOUBLE_EQ(data.surface_points(0).residual(), 4000);
  ASSERT_EQ(data.worst_touches_size(), 1);
  EXPECT_DOUBLE_EQ(data.worst_touches(0).residual(0), 20000);
  EXPECT_TRUE(std::isnan(data.worst_touches(0).residual(1)));
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
  diagnosis.next = {proposed};
  const v1::Report report = ToReport(diagnosis);
  ASSERT_EQ(report.next_size(), 1);
  EXPECT_EQ(report.next(0).purpose(), "tells tip_radius from oblique_slip");
  EXPECT_DOUBLE_EQ(report.next(0).separation(), 3.5);
  EXPECT_DOUBLE_EQ(report.next(0).touch().target_m().x(), 0.01);
  EXPECT_DOUBLE_EQ(report.next(0).touch().speed_m_s(), 0.04);
  EXPECT_FALSE(report.next(0).touch().has_session_time_s());
}

TEST(ToReport, ProposesPicturesBesideTouches) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kMissingEffects);
  images::ProposedPhotograph picture;
  picture.object = "lat20";
  picture.camera.eye_m = {0.1, 0, 0};
  picture.photographs_to_verdict = 3;
  diagnosis.next = {design::ProposedTouch(), picture};
  const v1::Report report = ToReport(diagnosis);
  ASSERT_EQ(report.next_size(), 2);
  EXPECT_TRUE(report.next(0).has_touch());
  EXPECT_TRUE(report.next(1).has_photograph());
  EXPECT_DOUBLE_EQ(report.next(1).photograph().eye_m().x(), 0.1);
  EXPECT_EQ(report.next(1).count_to_verdict(), 3u);
}

TEST(ToReport, OfNoTouchesHasNoErrorAndNoFloor) {
  touches::DataSummary set;
  set.fingers = 2;
  Diagnosis diagnosis;
  diagnosis.verdict = Verdict::kTooLittleData;
  diagnosis.data = {DataOfTouches(set)};
  diagnosis.warnings = {"No touch could be used."};
  const v1::Report report = ToReport(diagnosis);
  EXPECT_EQ(report.data(0).count(), 0u);
  EXPECT_FALSE(report.data(0).has_noise());
  EXPECT_FALSE(report.data(0).has_initial());
  EXPECT_FALSE(report.data(0).has_final());
  EXPECT_THAT(report.data(0).fingers(), ElementsAre("0", "1"));
  EXPECT_THAT(report.warnings(), ElementsAre("No touch could be used."));
}

}  // namespace
}  // namespace touchstone::diagnosis::report
