#include "server/diagnosis/report/words/summary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/report/join.h"
#include "server/diagnosis/report/kinds/example_diagnosis.h"

namespace touchstone::diagnosis::report {
namespace {

using engine::Verdict;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

TEST(Summarize, BeginsWithTheErrorAndItsShareOfNoise) {
  EXPECT_THAT(
      Summarize(ExampleDiagnosis(Verdict::kAdequate)),
      StartsWith("The model is off by 41 ms; 5 ms is noise, so 98.5 % of the mean square error is the "
                 "model's."));
}

// A few gross errors are most of the error of all.
TEST(Summarize, GivesErrorAndShareOfTheSameTouchesWhereSomeAreSetAside) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kUnexplained);
  DataReport& data = diagnosis.data[0];
  data.set_aside.outliers = 26;
  data.reducible_share = 0;
  EXPECT_THAT(Summarize(diagnosis),
              StartsWith("The model is off by 41 ms with the 26 set aside, and by no more than 5 ms without "
                         "them; 5 ms is noise, so 0 % of the mean square error of those is the model's."));
  data.reducible_share = 0.75;
  EXPECT_THAT(Summarize(diagnosis), HasSubstr("and by 10 ms without them"));
}

TEST(Summarize, CallsAFloorWithoutRepeatsAnUpperBound) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kAdequate);
  diagnosis.data[0].noise_floor->from_repeats = false;
  EXPECT_THAT(Summarize(diagnosis), HasSubstr("5 ms is noise at most"));
}

TEST(Summarize, SaysThatRepeatsScatterByMoreThanTheModelSays) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kAdequate);
  NoiseFloor& floor = *diagnosis.data[0].noise_floor;
  floor.sigma = 13000, floor.lower = 12500, floor.upper = 13500;
  floor.from_repeats = true;
  EXPECT_THAT(Summarize(diagnosis), Not(HasSubstr("Repeats scatter")));
  floor.declared = 5000;
  EXPECT_THAT(Summarize(diagnosis),
              HasSubstr("Repeats scatter by 13 ms (12.5 ms to 13.5 ms), where the model says 5 ms of noise"));
  floor.declared = 13300;
  EXPECT_THAT(Summarize(diagnosis), Not(HasSubstr("Repeats scatter")));
}

TEST(Summarize, CallsNoiseThatIsNotThereSuperfluous) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kWrongValues);
  diagnosis.superfluous = {"poll_interval", "tip_radius"};
  EXPECT_THAT(Summarize(diagnosis), HasSubstr("without poll_interval: their scatter shows no trace of it"));
  EXPECT_THAT(Summarize(diagnosis), HasSubstr("without tip_radius: its value is zero"));
}

TEST(Summarize, WithoutNoiseGivesTheErrorAlone) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kNone);
  diagnosis.data[0].noise_floor->sigma = 0;
  EXPECT_EQ(Summarize(diagnosis), "The model is off by 41 ms.");
}

TEST(Summarize, OfAComparisonHasNoVerdict) {
  const std::string summary = Summarize(ExampleDiagnosis(Verdict::kNone));
  EXPECT_THAT(summary, Not(HasSubstr("issing")));
  EXPECT_THAT(summary, Not(HasSubstr("is left")));
}

TEST(Summarize, OfAnAdequateModelClaimsNothing) {
  const std::string summary = Summarize(ExampleDiagnosis(Verdict::kAdequate));
  EXPECT_THAT(summary, HasSubstr("Nothing is missing that these data could show."));
  EXPECT_THAT(summary, Not(HasSubstr("Missing:")));
}

TEST(Summarize, NamesAStepWithItsValueAndWhatIsLeft) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kMissingEffects);
  diagnosis.steps = {ExampleStep("tip_radius")};
  const std::string summary = Summarize(diagnosis);
  EXPECT_THAT(summary, HasSubstr("Missing: tip_radius (radius_mm 2.98 +- 0.02 mm)."));
  EXPECT_THAT(summary, HasSubstr("Then 5 ms is left."));
  EXPECT_THAT(summary, Not(HasSubstr("cannot tell them apart")));
}

TEST(Summarize, NamesBothStepsAndWhatWouldTellEquivalentsApart) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kMissingEffects);
  diagnosis.steps = {ExampleStep("speed_error"), ExampleStep("tip_radius")};
  diagnosis.steps[0].equivalent = {"clock_skew", "contact_slowdown"};
  diagnosis.steps[0].discriminating_measurement = "Touch at two speeds.";
  const std::string summary = Summarize(diagnosis);
  EXPECT_THAT(summary, HasSubstr("Missing: speed_error or clock_skew or contact_slowdown ("));
  EXPECT_THAT(summary, HasSubstr("These data cannot tell them apart. Touch at two speeds."));
  EXPECT_THAT(summary, HasSubstr("Missing: tip_radius ("));
}

TEST(Summarize, CountsValuesThatAreTooManyToWrite) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kMissingEffects);
  diagnosis.steps = {ExampleStep("object_pose")};
  diagnosis.steps[0].parameters.assign(6, RadiusMm());
  EXPECT_THAT(Summarize(diagnosis), HasSubstr("Missing: object_pose (6 values)."));
}

TEST(Summarize, NamesTheFingerOfAValue) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kMissingEffects);
  diagnosis.steps = {ExampleStep("finger_length")};
  diagnosis.steps[0].parameters[0].entry = "l";
  EXPECT_THAT(Summarize(diagnosis), HasSubstr("radius_mm l 2.98 +- 0.02 mm"));
}

TEST(Summarize, SaysWhichValueOfTheModelIsAnother) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kWrongValues);
  diagnosis.refitted = {{"tip_radius", {RadiusMm()}}};
  const std::string summary = Summarize(diagnosis);
  EXPECT_THAT(summary, HasSubstr("tip_radius has another value: radius_mm 2.98 +- 0.02 mm."));
  EXPECT_THAT(summary, HasSubstr("Then 5 ms is left."));
  EXPECT_THAT(summary, Not(HasSubstr("Missing:")));
}

TEST(Summarize, SuggestsAFormulaForWhatNoEffectExplains) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kUnexplained);
  diagnosis.data[0].unexplained.emplace();
  diagnosis.data[0].unexplained->covariates = {{"travel_mm", 1e-9, 80}};
  diagnosis.data[0].unexplained->formula = "k * sin(2*pi*travel_mm/lead)";
  diagnosis.data[0].unexplained->rmse = 7000;
  const std::string summary = Summarize(diagnosis);
  EXPECT_THAT(summary, HasSubstr("depends on travel_mm"));
  EXPECT_THAT(summary, HasSubstr("A suggestion: k * sin(2*pi*travel_mm/lead)"));
  EXPECT_THAT(summary, HasSubstr("would leave 7 ms."));
  EXPECT_THAT(summary, Not(HasSubstr("Nothing is missing")));
}

TEST(Summarize, AdmitsThatNotEvenAFormulaFits) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kUnexplained);
  diagnosis.data[0].unexplained.emplace();
  EXPECT_THAT(Summarize(diagnosis),
              HasSubstr("A structure remains that neither an effect of the catalogue nor a simple formula "
                        "explains."));
}

TEST(Summarize, GivesTheMistakeAndTheCommandThatFixesIt) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kCheckData);
  diagnosis.data_problems = {
      {engine::ProblemKind::kFingerOrder, "l <-> m", "Fingers l and m are swapped.",
       "touchstone session fix set.csv --swap-fingers l,m -o fixed.csv", 41000, 5100},
      {engine::ProblemKind::kWrongMesh, "lat20", "lat20 has another shape.", "", 41000, 30000}};
  const std::string summary = Summarize(diagnosis);
  EXPECT_THAT(summary, HasSubstr("Fingers l and m are swapped."));
  EXPECT_THAT(summary, HasSubstr("touchstone session fix set.csv --swap-fingers l,m -o fixed.csv"));
  EXPECT_THAT(summary, testing::HasSubstr("lat20 has another shape. P(nothing"));
}

TEST(Summarize, SaysWhyNothingMissingIsNotAssessedOfAMistake) {
  EXPECT_THAT(Summarize(ExampleDiagnosis(Verdict::kCheckData)),
              HasSubstr("P(nothing is missing) is not assessed: a mistake in the data comes first."));
}

TEST(Summarize, SaysHowManyTouchesAVerdictNeeds) {
  Diagnosis diagnosis = ExampleDiagnosis(Verdict::kTooLittleData);
  diagnosis.data[0].needed = 60;
  EXPECT_THAT(Summarize(diagnosis), HasSubstr("too little for a verdict; 60 usable touches would do"));
}

TEST(Summarize, OfNoTouchesSaysNothingOfTheModel) {
  Diagnosis diagnosis;
  diagnosis.verdict = Verdict::kTooLittleData;
  diagnosis.data.resize(1);
  EXPECT_EQ(Summarize(diagnosis), "No touch could be used: nothing can be said of the model.");
  EXPECT_THAT(DataWarnings(diagnosis.data[0]), ElementsAre(Summarize(diagnosis)));
}

TEST(DataWarnings, OfAGoodSetAreNone) {
  EXPECT_THAT(DataWarnings(ExampleDiagnosis(Verdict::kNone).data[0]), IsEmpty());
}

TEST(DataWarnings, NameWhatLimitsTheSet) {
  DataReport data = ExampleDiagnosis(Verdict::kNone).data[0];
  data.count = 1;
  data.rows = 10;
  data.objects = {"lat20"};
  data.repeats = 0;
  data.set_aside.rows = {{"a finger missed", 9, {}}};
  data.emulated = 10;
  const std::vector<std::string> warnings = DataWarnings(data);
  EXPECT_THAT(warnings, Contains(StartsWith("Only 1 touch took part")));
  EXPECT_THAT(warnings, Contains(StartsWith("The touches are emulated (cov_emulated)")));
  EXPECT_THAT(warnings, Contains(StartsWith("One object only")));
  EXPECT_THAT(warnings, Contains(StartsWith("No touch was repeated")));
  EXPECT_THAT(warnings, Contains(StartsWith("9 of 10 rows could not be used")));
}

TEST(DataWarnings, NameAClockThatGoesBackwards) {
  DataReport data = ExampleDiagnosis(Verdict::kNone).data[0];
  data.backward_times = {2, 7, 0.5, 30};
  EXPECT_THAT(
      DataWarnings(data),
      ElementsAre(StartsWith("session_time_s goes backwards at 2 rows, first from 30 to 0.5 s at touch 7:")));
}

Diagnosis AdequatePhotographs() {
  Diagnosis photographs;
  photographs.verdict = Verdict::kAdequate;
  photographs.data.resize(1);
  photographs.data[0].kind = DataKind::kPhotographs;
  photographs.data[0].count = 20;
  photographs.data[0].initial = Quality{12.34, 13, 0.3};
  return photographs;
}

TEST(Summarize, GivesErrorsOfPhotographsInGreyLevels) {
  const std::string summary = Summarize(AdequatePhotographs());
  EXPECT_THAT(summary, StartsWith("The model is off by 12.3 grey levels."));
  EXPECT_THAT(summary, HasSubstr("Nothing is missing that these pictures could show."));
}

TEST(Join, NamesVerdictsThatAgreeWithTheirWords) {
  JointParts parts;
  parts.touches = ExampleDiagnosis(Verdict::kAdequate);
  parts.photographs = AdequatePhotographs();
  EXPECT_THAT(Join(parts).summary,
              AllOf(HasSubstr("Nothing is missing that these data"), HasSubstr("Photographs (ADEQUATE): "),
                    HasSubstr("Nothing is missing that these pictures")));
  joint::SharedStep step;
  step.effect = "object_pose", step.shown_by = "both";
  parts.shared.steps.push_back(step);
  parts.shared_quality.resize(1);
  EXPECT_THAT(Join(parts).summary,
              AllOf(HasSubstr("Photographs (ADEQUATE, with object_pose in place): "),
                    HasSubstr("Nothing else is missing that these data"),
                    HasSubstr("Nothing else is missing that these pictures"),
                    Not(HasSubstr("Nothing is missing")), Not(HasSubstr("MISSING_EFFECTS"))));
}

}  // namespace
}  // namespace touchstone::diagnosis::report
