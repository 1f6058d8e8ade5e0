// What a report promises whatever is hidden: errors are those of the saved model, what was set aside is judged, data without
// noise are no misfit.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/numbers/random.h"
#include "server/base/test_tier.h"
#include "server/diagnosis/checks/data_problems.h"
#include "server/diagnosis/diagnose.h"
#include "server/diagnosis/joint_test_set.h"
#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis {
namespace {

using ::testing::HasSubstr;

report::Diagnosis Diagnosed(const DiagnosisInput& input) {
  const absl::StatusOr<report::Diagnosis> diagnosis = Diagnose(input, {});
  EXPECT_TRUE(diagnosis.ok()) << diagnosis.status();
  return diagnosis.ok() ? *diagnosis : report::Diagnosis();
}

// What a comparison with this model finds, us.
double Compared(DiagnosisInput input, const model::Model& model) {
  input.model = std::make_shared<const model::Model>(model);
  const absl::StatusOr<report::Diagnosis> compared = Compare(input, {});
  EXPECT_TRUE(compared.ok()) << compared.status();
  return compared.ok() ? compared->data[0].initial->rmse : NAN;
}

DiagnosisInput Corrupted(DiagnosisInput input, const std::function<void(session::MeasurementSet*)>& corrupt) {
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  corrupt(set.get());
  input.set = set;
  return input;
}

// Every error of the ladder is that of a model that a comparison can be given, and each is less than the one before.
void ExpectErrorsAsCompared(const DiagnosisInput& input, const report::Diagnosis& diagnosis) {
  const report::DataReport& data = diagnosis.data[0];
  double last = Compared(input, *input.model);
  EXPECT_NEAR(data.initial->rmse, last, 1e-6 * last);
  for (size_t j = 0; j < diagnosis.steps.size(); ++j) {
    const auto effect = effects::Catalogue().Find(diagnosis.steps[j].effect);
    if (effect == nullptr || effect->random()) continue;
    const double with = Compared(input, diagnosis.steps[j].model);
    EXPECT_NEAR(data.after_step[j].rmse, with, 1e-3 * with) << diagnosis.steps[j].effect;
    EXPECT_LT(with, last) << diagnosis.steps[j].effect;
    last = with;
  }
  if (diagnosis.improved_model) {
    const double improved = Compared(input, *diagnosis.improved_model);
    EXPECT_NEAR(data.final->rmse, improved, 1e-3 * improved);
    EXPECT_LE(improved, 1.0001 * data.initial->rmse);
  }
  if (data.unexplained && data.unexplained->model_with) {
    const double with = Compared(input, *data.unexplained->model_with);
    EXPECT_NEAR(data.unexplained->rmse, with, 1e-3 * with);
    EXPECT_LT(with, data.final->rmse);
  }
}

// A formula before, and one behind, a push that was fitted beside it; one over the press before; two named effects.
TEST(HonestReport, SavesWhatItsLadderShows) {
  const std::pair<std::string, std::vector<std::string>> screw = {
      "formula", {"name=screw", "adds=travel_mm", "expression=0.5*sin(2*pi*travel_mm/5)"}};
  const std::pair<std::string, std::vector<std::string>> press = {
      "formula", {"name=press", "adds=travel_mm", "expression=-0.05*previous_press_mm*(finger==1)"}};
  const std::pair<std::string, std::vector<std::string>> push = {"object_push", {"shift_mm=0.8"}};
  for (const auto& hidden : std::vector<decltype(touches::HiddenRig::hidden)>{
           {screw, push}, {push, press}, {{"tip_radius", {"radius_mm=1.5"}}, push}}) {
    SCOPED_TRACE(hidden[0].first + " and " + hidden[1].first);
    touches::HiddenRig rig;
    rig.samples_per_face = 6;
    rig.hidden = hidden;
    const DiagnosisInput input = touches::MakeTestInput(rig);
    const report::Diagnosis diagnosis = Diagnosed(input);
    EXPECT_TRUE(diagnosis.improved_model || diagnosis.data[0].unexplained);
    ExpectErrorsAsCompared(input, diagnosis);
  }
}

TEST(HonestReport, ForbidsAdequateWhereManyTouchesAreSetAside) {
  const DiagnosisInput input = Corrupted(touches::MakeTestInput({}), [](session::MeasurementSet* set) {
    RandomStream random(3, RandomDomain::kDiagnosis, 1);
    for (int row = 0; row < set->size(); ++row)
      if (random.Uniform() < 0.04) set->time_s[row * 3 + random.Below(3)] += 0.1;
  });
  const report::Diagnosis diagnosis = Diagnosed(input);
  EXPECT_NE(diagnosis.verdict, engine::Verdict::kAdequate) << diagnosis.summary;
  EXPECT_TRUE(diagnosis.verdict == engine::Verdict::kUnexplained || !diagnosis.steps.empty());
}

// Kind: what one reading may do to the verdict on all others. Far off, and farther than any object is thick.
TEST(HonestReport, SetsOneWildReadingAsideAndNamesIt) {
  touches::HiddenRig rig;
  rig.hidden = {{"tip_radius", {"radius_mm=2"}}};
  const DiagnosisInput input = touches::MakeTestInput(rig);
  const report::Diagnosis whole = Diagnosed(input);
  ASSERT_EQ(whole.steps.size(), 1u);
  for (const double late_s : {0.6, 3.0, 1000.0}) {
    const report::Diagnosis diagnosis = Diagnosed(
        Corrupted(input, [late_s](session::MeasurementSet* set) { set->time_s[3 * 7 + 1] += late_s; }));
    EXPECT_EQ(diagnosis.verdict, engine::Verdict::kMissingEffects) << late_s << ": " << diagnosis.summary;
    ASSERT_EQ(diagnosis.steps.size(), 1u) << late_s;
    EXPECT_EQ(diagnosis.steps[0].effect, "tip_radius");
    EXPECT_NEAR(diagnosis.data[0].reducible_share, whole.data[0].reducible_share, 0.05) << late_s;
    EXPECT_EQ(diagnosis.data[0].set_aside.count(), whole.data[0].set_aside.count() + 1) << late_s;
  }
}

// The times of one object's last round belong to other poses of the round.
TEST(HonestReport, NamesTheRoundAndTheObjectThatWereSetAside) {
  const DiagnosisInput input = Corrupted(touches::MakeTestInput({}), [](session::MeasurementSet* set) {
    const int last = 72 + 48;  // the second object's rows 72 to 143, its last round from here
    for (int row = last; row < last + 5; ++row)
      for (int i = 0; i < 3; ++i)
        std::swap(set->time_s[row * 3 + i], set->time_s[(2 * last + 9 - row) * 3 + i]);
  });
  const report::Diagnosis diagnosis = Diagnosed(input);
  EXPECT_EQ(diagnosis.verdict, engine::Verdict::kUnexplained) << diagnosis.summary;
  EXPECT_THAT(diagnosis.summary, HasSubstr("of lat10"));
  EXPECT_THAT(diagnosis.summary, HasSubstr("of round 2"));
}

TEST(HonestReport, CallsDataWithoutNoiseRoundedAndNamesNoNoise) {
  for (const int rounds : {1, 3}) {
    SCOPED_TRACE(rounds);
    touches::HiddenRig rig;
    rig.rounds = rounds;
    rig.sigma_us = 0;
    DiagnosisInput input = touches::MakeTestInput(rig);
    input.model = std::make_shared<const model::Model>(model::NominalModel());
    const report::Diagnosis exact = Diagnosed(input);
    EXPECT_EQ(exact.verdict, engine::Verdict::kAdequate) << exact.summary;
    EXPECT_TRUE(exact.data[0].noise_floor->is_rounding);
    EXPECT_EQ(exact.p_nothing_missing, 1);
    EXPECT_THAT(exact.summary, HasSubstr("rounding"));

    rig.hidden = {{"tip_radius", {"radius_mm=1.5"}}};
    DiagnosisInput wrong = touches::MakeTestInput(rig);
    wrong.model = input.model;
    for (const report::Step& step : Diagnosed(wrong).steps)
      EXPECT_FALSE(effects::Catalogue().Find(step.effect)->random()) << step.effect;
  }
}

TEST(HonestReport, SaysHowLikelyDataOfTheGivenModelLookAsBad) {
  const report::Diagnosis nothing = Diagnosed(touches::MakeTestInput({}));
  ASSERT_TRUE(nothing.p_nothing_missing);
  EXPECT_GT(*nothing.p_nothing_missing, 0.01);
  EXPECT_GT(nothing.hypotheses_tried, 80);
  touches::HiddenRig rig;
  rig.hidden = {{"tip_radius", {"radius_mm=1.5"}}};
  EXPECT_LT(*Diagnosed(touches::MakeTestInput(rig)).p_nothing_missing, 1e-6);
  DiagnosisInput noiseless = touches::MakeTestInput({});
  noiseless.model = std::make_shared<const model::Model>(model::NominalModel());
  EXPECT_EQ(Diagnosed(noiseless).p_nothing_missing, 0);
  // The size of the noise alone is no sign that something is missing.
  DiagnosisInput quiet = touches::MakeTestInput({});
  quiet.model = std::make_shared<const model::Model>(
      touches::WithEffects(model::NominalModel(), {{"gaussian_noise", {"sigma_us=9000"}}}));
  EXPECT_GT(*Diagnosed(quiet).p_nothing_missing, 0.01);
}

TEST(HonestReport, SaysThatAPartOfTheTimesWasReadInTicks) {
  const DiagnosisInput input = Corrupted(touches::MakeTestInput({}), [](session::MeasurementSet* set) {
    for (int row = 0; row < set->size(); ++row) {
      const double step_s = row % 2 == 0 ? 0.01 : 1e-6;
      for (int i = 0; i < 3; ++i)
        set->time_s[row * 3 + i] = std::round(set->time_s[row * 3 + i] / step_s) * step_s;
    }
  });
  const report::Diagnosis diagnosis = Diagnosed(input);
  EXPECT_EQ(diagnosis.verdict, engine::Verdict::kUnexplained);
  EXPECT_THAT(diagnosis.summary, HasSubstr("lie on ticks of 10 ms"));
  EXPECT_LT(*diagnosis.p_nothing_missing, 1e-6);
}

// Objects lat00, lat05 ..., 48 poses each, with a push in round 2 of 4.
DiagnosisInput PushedInOneRound(touches::HiddenRig rig) {
  rig.samples_per_face = 8;
  rig.rounds = 4;
  rig.sigma_us = 5000;
  const DiagnosisInput right = touches::MakeTestInput(rig);
  rig.hidden = {{"object_push", {"shift_mm=0.1"}}};
  const DiagnosisInput pushed = touches::MakeTestInput(rig);
  return Corrupted(right, [&](session::MeasurementSet* set) {
    for (int row = 0; row < set->size(); ++row)
      if (row / 48 % 4 == 2)
        for (int i = 0; i < 3; ++i) set->time_s[row * 3 + i] = pushed.set->time_s[row * 3 + i];
  });
}

// An effect of one round is neither one of all touches, nor noise, nor the speed of that round.
TEST(HonestReport, AnEffectOfOneRoundIsToldAsSuch) {
  touches::HiddenRig rig;
  rig.objects = {"lat00", "lat05", "lat10", "lat15", "lat20"};
  const DiagnosisInput mixed = PushedInOneRound(rig);
  // By itself, the round looks as if it had been made at another speed.
  EXPECT_FALSE(checks::FindRoundAtAnotherSpeed(mixed, nullptr).empty());
  const report::Diagnosis diagnosis = Diagnosed(mixed);
  EXPECT_EQ(diagnosis.verdict, engine::Verdict::kUnexplained);
  EXPECT_TRUE(diagnosis.steps.empty());
  ASSERT_TRUE(diagnosis.data[0].unexplained.has_value());
  const engine::UnexplainedRest& rest = *diagnosis.data[0].unexplained;
  EXPECT_THAT(rest.words, HasSubstr("in round 2: object_push differs there by shift_mm +0."));
  EXPECT_EQ(rest.covariates[0].name, "round");
}

TEST(HonestReport, AnEffectOfOneRoundIsToldAsSuchBesidePhotographs) {
  TOUCHSTONE_SECOND_TIER("long: whole diagnoses of pictures and touches");
  joint::HiddenSession session;
  session.camera.side_px = 64;
  session.rig.objects = {"lat00", "lat05", "lat10", "lat15", "lat20"};
  const DiagnosisInput photographed = joint::MakeJointInput(session);
  DiagnosisInput both = PushedInOneRound(session.rig);
  ASSERT_FALSE(checks::FindRoundAtAnotherSpeed(both, nullptr).empty());
  both.images = photographed.images;
  both.model = photographed.model;
  const report::Diagnosis diagnosis = Diagnosed(both);
  EXPECT_EQ(diagnosis.verdict, engine::Verdict::kUnexplained);
  EXPECT_TRUE(diagnosis.data_problems.empty());
  ASSERT_TRUE(diagnosis.data[0].unexplained.has_value());
  EXPECT_THAT(diagnosis.data[0].unexplained->words, HasSubstr("in round 2: object_push differs there"));
}

TEST(HonestReport, ARoundAtAnotherSpeedIsAMistakeOfTheFile) {
  touches::HiddenRig rig;
  rig.rounds = 4;
  const report::Diagnosis diagnosis = Diagnosed(Corrupted(touches::MakeTestInput(rig), [](auto* set) {
    for (int row = 0; row < set->size(); ++row)
      if (row / 24 % 4 == 2)
        for (int i = 0; i < 3; ++i) set->time_s[row * 3 + i] /= 1.05;
  }));
  EXPECT_EQ(diagnosis.verdict, engine::Verdict::kCheckData);
  ASSERT_EQ(diagnosis.data_problems.size(), 1u);
  EXPECT_EQ(diagnosis.data_problems[0].kind, engine::ProblemKind::kSpeedFactor);
}

// Kind: a mistake of the file explains more than what was found without it.
TEST(HonestReport, ASlipThatGrowsIsNoRoundAtAnotherSpeed) {
  touches::HiddenRig rig;
  rig.samples_per_face = 8;
  DiagnosisInput input = touches::MakeTestInput(rig);
  rig.hidden = {{"oblique_slip", {"travel_mm=1.2"}}};
  const DiagnosisInput slipping = touches::MakeTestInput(rig);
  // The objects take turns, so that rounds follow one another: the session's time, and with it the slip.
  const int per_object = input.set->size() / 3, per_round = per_object / 3;
  const report::Diagnosis diagnosis = Diagnosed(Corrupted(input, [&](auto* set) {
    for (int row = 0; row < set->size(); ++row) {
      const int within = row % per_object, round = within / per_round;
      set->session_time_s[row] = 9.0 * (3 * per_round * round + 3 * (within % per_round) + row / per_object);
      const double share = set->session_time_s[row] / (9.0 * set->size());
      for (int i = 0; i < 3; ++i)
        set->time_s[row * 3 + i] += share * (slipping.set->time_s[row * 3 + i] - set->time_s[row * 3 + i]);
    }
  }));
  EXPECT_EQ(diagnosis.verdict, engine::Verdict::kUnexplained);
  ASSERT_TRUE(diagnosis.data[0].unexplained.has_value());
  EXPECT_THAT(diagnosis.data[0].unexplained->formula,
              HasSubstr("tan(incidence_deg*pi/180) * session_time_s"));
}

}  // namespace
}  // namespace touchstone::diagnosis
