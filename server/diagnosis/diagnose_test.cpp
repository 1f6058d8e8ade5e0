#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/base/test_tier.h"
#include "server/diagnosis/checks/sampled_set.h"
#include "server/diagnosis/diagnose.h"
#include "server/diagnosis/engine/competition/rules.h"
#include "server/diagnosis/report/message/write_report.h"
#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis {
namespace {

using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::HasSubstr;

report::Diagnosis DiagnoseRig(const touches::HiddenRig& rig) {
  const absl::StatusOr<report::Diagnosis> diagnosis = Diagnose(touches::MakeTestInput(rig), {});
  EXPECT_TRUE(diagnosis.ok()) << diagnosis.status();
  return diagnosis.ok() ? *diagnosis : report::Diagnosis();
}

std::vector<std::string> StepNames(const report::Diagnosis& report) {
  std::vector<std::string> names;
  for (const report::Step& step : report.steps) names.push_back(step.effect);
  return names;
}

TEST(Diagnose, FindsNothingWhereNothingIsHidden) {
  const report::Diagnosis report = DiagnoseRig({});
  EXPECT_EQ(report.verdict, engine::Verdict::kAdequate) << report.summary;
  EXPECT_EQ(report.steps.size(), 0u);
  EXPECT_NEAR(report.data[0].noise_floor->sigma, 2000, 150);
  EXPECT_GT(report.data[0].initial->lack_of_fit_p, 0.001);
  EXPECT_FALSE(report.improved_model);
}

// The first rows of a set.
DiagnosisInput FirstTouches(int count, const touches::HiddenRig& rig) {
  DiagnosisInput input = touches::MakeTestInput(rig);
  std::vector<int> rows(count);
  std::iota(rows.begin(), rows.end(), 0);
  input.set = checks::PartOf(*input.set, rows, 0);
  return input;
}

TEST(Diagnose, SaysThatAFewTouchesAreTooLittleAndHowManyWouldDo) {
  touches::HiddenRig rig;
  rig.hidden = {{"tip_radius", {"radius_mm=3"}}};
  for (const int count : {1, 6, 15}) {
    const absl::StatusOr<report::Diagnosis> report = Diagnose(FirstTouches(count, rig), {});
    ASSERT_TRUE(report.ok()) << report.status();
    EXPECT_EQ(report->verdict, engine::Verdict::kTooLittleData) << count;
    // 31 contrasts are 16 touches, and more where fingers stay silent.
    EXPECT_GE(report->data[0].needed, 16) << count;
    EXPECT_LE(report->data[0].needed, 20) << count;
    EXPECT_TRUE(report->steps.empty());
    EXPECT_FALSE(report->improved_model);
    EXPECT_THAT(report->summary, HasSubstr(" usable touches would do"));
  }
  const absl::StatusOr<report::Diagnosis> enough = Diagnose(FirstTouches(24, rig), {});
  ASSERT_TRUE(enough.ok());
  EXPECT_NE(enough->verdict, engine::Verdict::kTooLittleData);
}

TEST(Diagnose, NeverCallsAModelGoodThatNoTouchWasComparedWith) {
  DiagnosisInput input = FirstTouches(30, {});
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  for (size_t i = 0; i < set->time_s.size(); ++i)
    if (i % 3 != 0) set->time_s[i] = NAN;
  input.set = set;
  const absl::StatusOr<report::Diagnosis> report = Diagnose(input, {});
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->verdict, engine::Verdict::kTooLittleData);
  EXPECT_EQ(report->data[0].count, 0);
  EXPECT_EQ(report->data[0].needed, 16);
}

TEST(Diagnose, ChecksTheFileBeforeThePhysics) {
  DiagnosisInput input = touches::MakeTestInput({});
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  for (double& time_s : set->time_s) time_s *= 1e-3;  // which was an error before
  input.set = set;
  const absl::StatusOr<report::Diagnosis> report = Diagnose(input, {});
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->verdict, engine::Verdict::kCheckData);
  ASSERT_FALSE(report->data_problems.empty());
  EXPECT_EQ(report->data_problems[0].kind, engine::ProblemKind::kUnitsTime);
  EXPECT_TRUE(report->steps.empty());
  EXPECT_FALSE(Compare(input, {}).ok());
}

TEST(Propose, StillProposesWhereThereIsTooLittleForAVerdict) {
  touches::HiddenRig rig;
  rig.hidden = {{"tip_radius", {"radius_mm=3"}}};
  const absl::StatusOr<report::Diagnosis> report = Propose(FirstTouches(8, rig), 4, {});
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->verdict, engine::Verdict::kTooLittleData);
  // Touches, or the reason why there are none.
  EXPECT_TRUE(!report->next.empty() ||
              std::any_of(report->warnings.begin(), report->warnings.end(), [](const std::string& warning) {
                return warning.rfind("No touch would tell", 0) == 0;
              }));
  EXPECT_TRUE(report->steps.empty());
}

TEST(Diagnose, NamesTheRadiusAndTheErrorFallsToTheFloor) {
  touches::HiddenRig rig;
  rig.hidden = {{"tip_radius", {"radius_mm=1.5"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  EXPECT_EQ(report.verdict, engine::Verdict::kMissingEffects);
  ASSERT_EQ(StepNames(report), std::vector<std::string>{"tip_radius"});
  const engine::ParameterEstimate& radius = report.steps[0].parameters[0];
  EXPECT_NEAR(radius.value, 1.5, 4 * radius.std_error);
  EXPECT_LT(radius.std_error, 0.05);
  EXPECT_LT(report.data[0].final->rmse, 1.06 * report.data[0].noise_floor->sigma);
  EXPECT_GT(report.data[0].initial->rmse, 3 * report.data[0].noise_floor->sigma);
  // The improved model can be written as a file, which holds the effect.
  ASSERT_TRUE(report.improved_model);
  const absl::StatusOr<model::Model> better =
      model::ParseModel(model::FormatModel(*report.improved_model), "better", effects::Catalogue());
  ASSERT_TRUE(better.ok()) << better.status();
  EXPECT_EQ(better->Hash(), report.improved_model->Hash());
  EXPECT_EQ(better->effects.back().effect->name, "tip_radius");
}

TEST(Diagnose, LeavesTheModelsEffectsOfPhotographsAsTheyAre) {
  touches::HiddenRig rig;
  rig.hidden = {{"tip_radius", {"radius_mm=1.5"}}};
  DiagnosisInput input = touches::MakeTestInput(rig);
  input.model = std::make_shared<const model::Model>(
      touches::WithEffects(*input.model, {{"exposure", {"stops=0.25"}}, {"image_noise", {"sigma_grey=3"}}}));
  const absl::StatusOr<report::Diagnosis> report = Diagnose(input, {});
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->model_hash, input.model->Hash());
  EXPECT_EQ(StepNames(*report), std::vector<std::string>{"tip_radius"});
  const std::optional<model::Model>& improved = report->improved_model;
  ASSERT_TRUE(improved);
  int kept = 0;
  for (const model::EffectInstance& instance : improved->effects) {
    kept += instance.effect->name == "exposure" && instance.values[0] == 0.25;
    kept += instance.effect->name == "image_noise" && instance.values[0] == 3;
  }
  EXPECT_EQ(kept, 2);
}

TEST(Diagnose, FindsTwoEffectsAtOnce) {
  touches::HiddenRig rig;
  rig.hidden = {{"oblique_slip", {"travel_mm=0.5"}}, {"object_push", {"shift_mm=0.4"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  EXPECT_THAT(StepNames(report), ::testing::UnorderedElementsAre("oblique_slip", "object_push"));
}

TEST(Diagnose, SaysWhatTheDataCannotTellApartAndWhatWould) {
  touches::HiddenRig rig;
  rig.hidden = {{"channel_latency", {"latency_us=9000,-3000,-6000"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  ASSERT_GE(report.steps.size(), 1u);
  std::vector<std::string> equivalent = report.steps[0].equivalent;
  equivalent.push_back(report.steps[0].effect);
  EXPECT_THAT(equivalent, Contains("channel_latency"));
  EXPECT_THAT(equivalent, Contains("finger_length"));
  EXPECT_THAT(report.steps[0].discriminating_measurement, HasSubstr("speed"));
  EXPECT_EQ(report.confounded.size(), 1u);
}

TEST(Diagnose, SaysThatAValueOfTheModelIsWrong) {
  touches::HiddenRig rig;
  rig.hidden = {{"tip_radius", {"radius_mm=2"}}};
  rig.known = {{"tip_radius", {"radius_mm=1"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  EXPECT_EQ(report.verdict, engine::Verdict::kWrongValues) << report.summary;
  ASSERT_EQ(report.refitted.size(), 1u);
  EXPECT_EQ(report.refitted[0].effect, "tip_radius");
  EXPECT_NEAR(report.refitted[0].parameters[0].value, 2, 0.1);
  EXPECT_EQ(report.refitted[0].parameters[0].before, 1);
}

TEST(Diagnose, AdmitsThatNothingOfTheCatalogueFitsAndSuggestsAFormula) {
  touches::HiddenRig rig;
  rig.samples_per_face = 6;
  rig.hidden = {{"formula",
                 {"name=odd", "adds=travel_mm", "expression=k*(finger==0)*approach_z", "k=0.4", "k_unit=mm",
                  "k_min=-1", "k_max=1"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  EXPECT_EQ(report.verdict, engine::Verdict::kUnexplained) << report.summary;
  ASSERT_GE(report.data[0].unexplained->covariates.size(), 1u);
  EXPECT_EQ(report.data[0].unexplained->covariates[0].name, "approach_z");
  EXPECT_THAT(report.data[0].unexplained->formula, HasSubstr("approach_z"));
  EXPECT_GT(report.data[0].unexplained->heldout_gain, 0.5);
  // The formula can be added as it stands.
  const std::string yaml =
      "touchstone: model/1\nname: m\nend_effector: {fingers: 3, spacing_mm: 30}\neffects:\n" +
      report.data[0].unexplained->formula_yaml;
  EXPECT_TRUE(model::ParseModel(yaml, "formula", effects::Catalogue()).ok()) << yaml;
}

TEST(Diagnose, LetsAFormulaOfTheUserCompete) {
  touches::HiddenRig rig;
  rig.hidden = {{"formula",
                 {"name=odd", "adds=travel_mm", "expression=k*(finger==0)*approach_z", "k=0.4", "k_unit=mm",
                  "k_min=-1", "k_max=1"}}};
  DiagnosisInput input = touches::MakeTestInput(rig);
  const model::Model mine = touches::WithEffects(
      model::NominalModel(), {{"formula",
                               {"name=mine", "adds=travel_mm", "expression=c*(finger==0)*approach_z", "c=0",
                                "c_unit=mm", "c_min=-1", "c_max=1"}}});
  input.also = {mine.effects[0].effect};
  const absl::StatusOr<report::Diagnosis> report = Diagnose(input, {});
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->verdict, engine::Verdict::kMissingEffects);
  ASSERT_EQ(StepNames(*report), std::vector<std::string>{"formula mine"});
  EXPECT_NEAR(report->steps[0].parameters[0].value, 0.4, 0.05);
}

TEST(Diagnose, FindsTheTicksOfAPollingLoop) {
  touches::HiddenRig rig;
  rig.sigma_us = 300;
  rig.hidden = {{"poll_interval", {"interval_us=8000"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  ASSERT_THAT(StepNames(report), Contains("poll_interval")) << report.summary;
  EXPECT_NEAR(report.steps[0].parameters[0].value, 8000, 1);
}

TEST(Diagnose, FindsHeavyTails) {
  TOUCHSTONE_SECOND_TIER("long: a whole diagnosis of a large set");
  touches::HiddenRig rig;
  rig.samples_per_face = 8;
  rig.rounds = 4;
  rig.hidden = {{"heavy_tail_noise", {"degrees_of_freedom=3"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  ASSERT_EQ(StepNames(report), std::vector<std::string>{"heavy_tail_noise"}) << report.summary;
  EXPECT_NEAR(report.steps[0].parameters[0].value, 3, 1);
}

TEST(Diagnose, FindsNoiseThatGrowsOnSlopes) {
  TOUCHSTONE_SECOND_TIER("long: a whole diagnosis of a large set");
  touches::HiddenRig rig;
  rig.samples_per_face = 8;
  rig.rounds = 4;
  rig.hidden = {{"incidence_noise", {"slope=2"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  ASSERT_EQ(StepNames(report), std::vector<std::string>{"incidence_noise"}) << report.summary;
  EXPECT_NEAR(report.steps[0].parameters[0].value, 2, 0.7);
}

TEST(Diagnose, SaysThatNoiseOfTheModelIsNotThere) {
  touches::HiddenRig rig;
  rig.samples_per_face = 8;
  rig.known = {{"poll_interval", {"interval_us=8000"}}, {"heavy_tail_noise", {"degrees_of_freedom=3"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  EXPECT_EQ(report.verdict, engine::Verdict::kWrongValues) << report.summary;
  EXPECT_THAT(report.superfluous, testing::UnorderedElementsAre("poll_interval", "heavy_tail_noise"));
  EXPECT_THAT(model::FormatModel(report.improved_model.value()), testing::Not(HasSubstr("poll_interval")));
  EXPECT_THAT(model::FormatModel(report.improved_model.value()), HasSubstr("gaussian_noise"));
}

TEST(Diagnose, KeepsNoiseOfTheModelThatIsThere) {
  touches::HiddenRig rig;
  rig.samples_per_face = 8;
  rig.sigma_us = 300;
  rig.hidden =
      rig.known = {{"poll_interval", {"interval_us=8000"}}, {"missed_contact", {"probability=0.05"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  EXPECT_TRUE(report.superfluous.empty()) << report.summary;
  EXPECT_TRUE(report.steps.empty()) << report.summary;
}

TEST(Diagnose, ALoudFingerIsNoHeavyTail) {
  TOUCHSTONE_SECOND_TIER("long: a whole diagnosis of a large set");
  touches::HiddenRig rig;
  rig.samples_per_face = 8;
  rig.rounds = 4;
  rig.hidden = {{"finger_noise", {"sigma_us=0,0,4000"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  ASSERT_EQ(StepNames(report), std::vector<std::string>{"finger_noise"}) << report.summary;
  ASSERT_EQ(report.steps[0].parameters.size(), 3u);
  EXPECT_EQ(report.steps[0].parameters[2].entry, "r");
  EXPECT_NEAR(report.steps[0].parameters[2].value, 4000, 4 * report.steps[0].parameters[2].std_error);
}

// The factor by which the model's sigma is off, and the verdict.
TEST(Diagnose, ASigmaThatIsOffByAFactorIsAWrongValueAndOneThatIsNearIsEstimatedAnew) {
  for (const auto& [declared_us, verdict] :
       {std::pair(900.0, engine::Verdict::kWrongValues), std::pair(1500.0, engine::Verdict::kAdequate),
        std::pair(2700.0, engine::Verdict::kAdequate), std::pair(6000.0, engine::Verdict::kWrongValues)}) {
    DiagnosisInput input = touches::MakeTestInput({});
    input.model = std::make_shared<const model::Model>(touches::WithEffects(
        model::NominalModel(), {{"gaussian_noise", {absl::StrCat("sigma_us=", declared_us)}}}));
    const absl::StatusOr<report::Diagnosis> report = Diagnose(input, {});
    ASSERT_TRUE(report.ok()) << report.status();
    EXPECT_EQ(report->verdict, verdict) << declared_us << ": " << report->summary;
    ASSERT_EQ(report->refitted.size(), 1u) << declared_us;
    EXPECT_NEAR(report->refitted[0].parameters[0].value, 2000, 200);
    EXPECT_THAT(report->summary, HasSubstr("Repeats scatter by")) << declared_us;
  }
}

TEST(Diagnose, FindsMissedContacts) {
  touches::HiddenRig rig;
  rig.hidden = {{"missed_contact", {"probability=0.1"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  ASSERT_EQ(StepNames(report), std::vector<std::string>{"missed_contact"}) << report.summary;
  EXPECT_NEAR(report.steps[0].parameters[0].value, 0.1, 0.04);
}

TEST(Diagnose, FindsHysteresisFromTheCourseOfTheSession) {
  touches::HiddenRig rig;
  rig.hidden = {{"return_hysteresis", {"fraction=0.05"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  ASSERT_EQ(StepNames(report), std::vector<std::string>{"return_hysteresis"}) << report.summary;
  EXPECT_NEAR(report.steps[0].parameters[0].value, 0.05, 0.01);
}

TEST(Diagnose, GivesTheSameReportTwiceAndWithThreads) {
  touches::HiddenRig rig;
  rig.hidden = {{"tool_tilt", {"angle_deg=0.5"}}};
  const DiagnosisInput input = touches::MakeTestInput(rig);
  ThreadPool pool(2);
  DiagnosisContext threads;
  threads.pool = &pool;
  absl::StatusOr<report::Diagnosis> a = Diagnose(input, {}), b = Diagnose(input, threads);
  ASSERT_TRUE(a.ok() && b.ok());
  a->duration_s = b->duration_s = 0;
  // Every value, whatever it is: the message holds them all.
  EXPECT_EQ(report::ToReport(*a).SerializeAsString(), report::ToReport(*b).SerializeAsString());
}

TEST(Diagnose, EndsWhenItIsCancelled) {
  touches::HiddenRig rig;
  rig.hidden = {{"tip_radius", {"radius_mm=1"}}};
  DiagnosisContext context;
  int calls = 0;
  context.progress = [&](const std::string&, double) { return ++calls < 10; };
  EXPECT_EQ(Diagnose(touches::MakeTestInput(rig), context).status().code(), absl::StatusCode::kCancelled);
}

TEST(Diagnose, RefusesAnObjectWithoutAMesh) {
  DiagnosisInput input = touches::MakeTestInput({});
  input.surfaces.erase("lat10");
  EXPECT_THAT(std::string(Diagnose(input, {}).status().message()), HasSubstr("--mesh lat10=FILE"));
}

TEST(Compare, RefusesTimesInTheWrongUnit) {
  DiagnosisInput input = touches::MakeTestInput({});
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  for (double& time_s : set->time_s) time_s *= 1e-3;
  input.set = set;
  const absl::Status status = Compare(input, {}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("milliseconds"));
}

TEST(Diagnose, NamesAMeshInAnotherUnitThatACompareRefuses) {
  DiagnosisInput input = touches::MakeTestInput({});
  for (const float scale : {0.1f, 1000.0f}) {  // cm for mm; m for mm
    geometry::TriangleMesh other = touches::TestSurface("lat10")->mesh();
    for (Eigen::Vector3f& vertex : other.vertices_m) vertex *= scale;
    input.surfaces["lat10"] = *geometry::Surface::Create("lat10", other);
    const absl::Status status = Compare(input, {}).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << scale;
    EXPECT_THAT(std::string(status.message()), HasSubstr("object 'lat10'"));
    const absl::StatusOr<report::Diagnosis> report = Diagnose(input, {});
    ASSERT_TRUE(report.ok()) << report.status();
    EXPECT_EQ(report->verdict, engine::Verdict::kCheckData) << scale;
    ASSERT_EQ(report->data_problems.size(), 1u);
    EXPECT_EQ(report->data_problems[0].kind, engine::ProblemKind::kUnitsLength);
    EXPECT_THAT(report->data_problems[0].detail, HasSubstr("lat10"));
  }
}

TEST(Diagnose, SurvivesSetsThatAreTooSmallToSayMuch) {
  const DiagnosisInput all = touches::MakeTestInput({});
  for (const int touches : {1, 2, 5, 20}) {
    auto set = std::make_shared<session::MeasurementSet>(*all.set);
    for (auto* column : {&set->target_m, &set->approach, &set->lateral}) column->resize(touches);
    for (auto* column : {&set->standoff_m, &set->speed_m_s, &set->session_time_s}) column->resize(touches);
    set->touch.resize(touches), set->object.resize(touches), set->line.resize(touches);
    set->time_s.resize(touches * 3);
    DiagnosisInput input = all;
    input.set = set;
    const absl::StatusOr<report::Diagnosis> report = Diagnose(input, {});
    ASSERT_TRUE(report.ok()) << report.status();
    EXPECT_EQ(report->verdict, touches < 16 ? engine::Verdict::kTooLittleData : engine::Verdict::kAdequate)
        << touches << ": " << report->summary;
    EXPECT_GE(report->warnings.size(), 1u);
  }
}

TEST(Diagnose, SurvivesASetInWhichNoFingerReported) {
  const DiagnosisInput all = touches::MakeTestInput({});
  auto set = std::make_shared<session::MeasurementSet>(*all.set);
  for (double& time_s : set->time_s) time_s = NAN;
  DiagnosisInput input = all;
  input.set = set;
  const absl::StatusOr<report::Diagnosis> report = Diagnose(input, {});
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->data[0].count, 0);
  ASSERT_EQ(report->data[0].set_aside.rows.size(), 1u);
  EXPECT_EQ(report->data[0].set_aside.count(), set->size());
}

TEST(Propose, NamesTouchesOfOtherSpeedsWhereLatencyAndLengthFitAlike) {
  touches::HiddenRig rig;
  rig.hidden = {{"channel_latency", {"latency_us=9000,-3000,-6000"}}};
  const absl::StatusOr<report::Diagnosis> report = Propose(touches::MakeTestInput(rig), 12, {});
  ASSERT_TRUE(report.ok()) << report.status();
  ASSERT_EQ(report->next.size(), 12u);
  for (const report::NextMeasurement& next : report->next) {
    const auto& touch = std::get<design::ProposedTouch>(next);
    EXPECT_GT(std::abs(touch.touch.speed_m_s - 0.02), 0.005);
    EXPECT_GT(touch.separation_sigmas, 0);
    EXPECT_FALSE(touch.purpose.empty());
  }
}

TEST(Propose, NamesTouchesEvenWhereNothingIsAmbiguous) {
  touches::HiddenRig rig;
  rig.known = {{"tip_radius", {"radius_mm=1"}}};
  rig.hidden = rig.known;
  const absl::StatusOr<report::Diagnosis> report = Propose(touches::MakeTestInput(rig), 5, {});
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_TRUE(report->next.size() == 5 || report->warnings.size() > 0);
}

TEST(Compare, TellsHowWrongTheModelIsAndWhere) {
  touches::HiddenRig rig;
  rig.samples_per_face = 8;
  rig.hidden = {{"finger_length", {"offset_mm=0.4,-0.2,-0.2"}}};
  const absl::StatusOr<report::Diagnosis> report = Compare(touches::MakeTestInput(rig), {});
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->verdict, engine::Verdict::kNone);
  EXPECT_NEAR(report->data[0].noise_floor->sigma, 2000, 200);
  EXPECT_GT(report->data[0].reducible_share, 0.9);
  ASSERT_GE(report->data[0].where.size(), 1u);
  EXPECT_EQ(report->data[0].where[0].conditions, "finger = l");
  EXPECT_EQ(report->data[0].fingers.size(), 3u);
}

double ComparedRmse(DiagnosisInput input, const model::Model& model) {
  input.model = std::make_shared<const model::Model>(model);
  const absl::StatusOr<report::Diagnosis> compared = Compare(input, {});
  EXPECT_TRUE(compared.ok()) << compared.status();
  return compared.ok() && compared->data[0].initial ? compared->data[0].initial->rmse : NAN;
}

// Every error of the ladder against what a comparison with that step's model finds.
void ExpectErrorsAsCompared(const touches::HiddenRig& rig) {
  const DiagnosisInput input = touches::MakeTestInput(rig);
  const absl::StatusOr<report::Diagnosis> report = Diagnose(input, {});
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_NEAR(report->data[0].initial->rmse / ComparedRmse(input, *input.model), 1, 0.01);
  ASSERT_EQ(report->data[0].after_step.size(), report->steps.size());
  for (size_t i = 0; i < report->steps.size(); ++i) {
    const report::Step& step = report->steps[i];
    if (step.model.effects.empty()) continue;  // noise: it changes no expectation
    EXPECT_NEAR(report->data[0].after_step[i].rmse / ComparedRmse(input, step.model), 1, 0.01) << step.effect;
  }
  if (!report->improved_model) return;
  EXPECT_NEAR(report->data[0].final->rmse / ComparedRmse(input, *report->improved_model), 1, 0.01);
}

TEST(Diagnose, FindsTheErrorsThatAComparisonFinds) {
  touches::HiddenRig rig;
  ExpectErrorsAsCompared(rig);
  rig.hidden = {{"oblique_slip", {"travel_mm=0.5"}}, {"object_push", {"shift_mm=0.4"}}};
  ExpectErrorsAsCompared(rig);
  rig.hidden = {{"tip_radius", {"radius_mm=1.5"}}, {"surface_error", {"rms_mm=0.2", "length_mm=40"}}};
  ExpectErrorsAsCompared(rig);
}

TEST(Diagnose, ClaimsNoFallForASurfaceErrorThatNobodyKnows) {
  touches::HiddenRig rig;
  rig.samples_per_face = 8;
  rig.hidden = {{"surface_error", {"rms_mm=0.2", "length_mm=40"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  ASSERT_EQ(StepNames(report), std::vector<std::string>{"surface_error"}) << report.summary;
  EXPECT_EQ(report.verdict, engine::Verdict::kMissingEffects);
  EXPECT_EQ(report.data[0].after_step[0].rmse, report.data[0].initial->rmse);
  EXPECT_EQ(report.data[0].final->rmse, report.data[0].initial->rmse);
  EXPECT_THAT(report.steps[0].words, HasSubstr("at poses left out"));
}

TEST(Diagnose, ExplainsItsOwnModelWithASurfaceError) {
  touches::HiddenRig rig;
  rig.samples_per_face = 8;
  rig.hidden = {{"surface_error", {"rms_mm=0.2", "length_mm=40"}}};
  rig.known = {{"surface_error", {"rms_mm=0.2", "length_mm=40"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  EXPECT_EQ(report.verdict, engine::Verdict::kAdequate) << report.summary;
}

TEST(Diagnose, AsksForALookAtTheSetUpWhereAValueIsLargerThanRigsShow) {
  touches::HiddenRig rig;
  // As object_push, but more than the 5 mm that rigs show.
  rig.hidden = {
      {"formula",
       {"name=push", "adds=travel_mm", "expression=k*(1-first)", "k=8", "k_unit=mm", "k_min=0", "k_max=10"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  ASSERT_EQ(StepNames(report), std::vector<std::string>{"object_push"}) << report.summary;
  EXPECT_NEAR(report.steps[0].parameters[0].value, 8, 0.02);
  EXPECT_LE(report.steps[0].probability, 0.9);
  EXPECT_THAT(report.steps[0].words, HasSubstr("Would need 8 mm, more than rigs show (up to 5 mm)"));
}

TEST(Diagnose, NamesTheOldValueBesideANewEffect) {
  touches::HiddenRig rig;
  rig.hidden = {{"finger_length", {"offset_mm=0.3,0,-0.3"}}};
  rig.known = {{"finger_length", {"offset_mm=0.01,0,-0.01"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  if (report.verdict == engine::Verdict::kWrongValues) return;  // the old value alone
  ASSERT_GE(report.steps.size(), 1u) << report.summary;
  EXPECT_THAT(report.steps[0].equivalent, Contains("given:finger_length")) << report.summary;
}

TEST(Diagnose, CallsAnEffectSuperfluousAndTakesItOut) {
  touches::HiddenRig rig;
  rig.known = {{"object_push", {"shift_mm=0.5"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  EXPECT_THAT(report.superfluous, Contains("object_push")) << report.summary;
  EXPECT_TRUE(report.refitted.empty()) << report.summary;
  EXPECT_THAT(model::FormatModel(report.improved_model.value()), ::testing::Not(HasSubstr("object_push")));
  EXPECT_NEAR(report.data[0].final->rmse, report.data[0].noise_floor->sigma,
              0.1 * report.data[0].noise_floor->sigma);
}

TEST(Diagnose, IsNeverCertain) {
  touches::HiddenRig rig;
  rig.hidden = {{"tip_radius", {"radius_mm=1.5"}}};
  const report::Diagnosis report = DiagnoseRig(rig);
  for (const report::Step& step : report.steps)
    EXPECT_LE(step.probability, engine::kCompetitionRules.max_probability.value());
  for (const report::Candidate& candidate : report.data[0].candidates)
    EXPECT_LE(candidate.probability, engine::kCompetitionRules.max_probability.value());
}

}  // namespace
}  // namespace touchstone::diagnosis
