#include "client/report/words/words.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "client/report/report.h"
#include "client/report/sample_reports.h"
#include "client/report/words/error_scale.h"

namespace touchstone::client {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

v1::ParameterValue Value(double value, double error, const char* unit) {
  v1::ParameterValue parameter;
  parameter.set_value(value);
  parameter.set_std_error(error);
  parameter.set_unit(unit);
  return parameter;
}

TEST(Time, IsInMicrosecondsBelowOneMillisecond) {
  EXPECT_EQ(Time(850), "850 us");
  EXPECT_EQ(Time(999.6), "1.00 ms");
  EXPECT_EQ(Time(41000), "41.0 ms");
  EXPECT_EQ(Time(2.5e6), "2.50 s");
  EXPECT_EQ(Time(std::nan("")), "n/a");
  EXPECT_EQ(SignedTime(9100), "+9.10 ms");
  EXPECT_EQ(SignedTime(-850), "-850 us");
}

TEST(TimeChange, SharesOneUnit) {
  EXPECT_EQ(TimeChange(41000, 5000), "41.0 -> 5.0 ms");
  EXPECT_EQ(TimeChange(1200, 815), "1.20 -> 0.82 ms");
}

TEST(ValueWithError, HasAsManyDigitsAsTheErrorAllows) {
  EXPECT_EQ(ValueWithError(Value(2.9812, 0.0211, "mm")), "2.98 +- 0.02 mm");
  EXPECT_EQ(ValueWithError(Value(2.9812, 0.0123, "mm")), "2.981 +- 0.012 mm");
  EXPECT_EQ(ValueWithError(Value(0, 0.0123, "mm")), "0.000 +- 0.012 mm");
  // Seven digits of a value, however small its error.
  EXPECT_EQ(ValueWithError(Value(20, 0.000001, "mm")), "20.00000 +- 1e-6 mm");
  EXPECT_EQ(ValueWithError(Value(20000, 0.001, "us")), "20.00000 +- 1e-6 ms");
  EXPECT_EQ(ValueWithError(Value(8200, 190, "us")), "8.20 +- 0.19 ms");
  EXPECT_EQ(ValueWithError(Value(-0.001, 0.5, "deg")), "0.0 +- 0.5 deg");
  EXPECT_EQ(ValueWithError(Value(20, 0, "mm/s")), "20 mm/s");
  EXPECT_EQ(ValueWithError(Value(20, std::nan(""), "mm/s")), "20.0 mm/s");
}

TEST(Probability, HasOneDigitOfSmallValues) {
  EXPECT_EQ(Probability(0), "< 1e-15");
  EXPECT_EQ(Probability(3.2e-9), "3e-9");
  EXPECT_EQ(Probability(0.0123), "0.012");
  EXPECT_EQ(Probability(0.44), "0.44");
}

TEST(EffectProbability, NeverClaimsCertainty) {
  EXPECT_EQ(EffectProbability(1), "> 0.99");
  EXPECT_EQ(EffectProbability(0.97), "0.97");
  EXPECT_EQ(EffectProbability(0), "< 0.01");
}

TEST(Share, ShowsTenthsNearTheEnds) {
  EXPECT_EQ(Share(0.985), "98.5 %");
  EXPECT_EQ(Share(0.71), "71 %");
  EXPECT_EQ(Share(0.04), "4.0 %");
  EXPECT_EQ(Share(1), "100 %");
}

TEST(Count, GroupsLongNumbers) {
  EXPECT_EQ(Count(960), "960");
  EXPECT_EQ(Count(8000), "8000");
  EXPECT_EQ(Count(1234567), "1 234 567");
}

TEST(Headline, SaysEveryVerdictInOneSentence) {
  EXPECT_EQ(Headline(MissingEffectsReport()),
            "The model lacks tip_radius (or surface_offset) and channel_latency; with them the error falls "
            "from 41.0 ms to 5.01 ms, the noise floor.");
  EXPECT_EQ(Headline(WrongValuesReport()),
            "No effect is missing, but the values of contact_slowdown are off: put right, the error falls "
            "from 9.10 ms to 815 us.");
  EXPECT_EQ(Headline(AdequateReport()), "Nothing is missing: 'nominal' is as good as 960 touches can tell.");
  EXPECT_EQ(Headline(CheckDataReport()),
            "Check the data before the model: lateral vectors reversed (lateral -> -lateral); fixed, the "
            "error falls "
            "from 866 ms to 14.4 ms.");
  EXPECT_EQ(Headline(TooLittleDataReport()),
            "Too little data for a verdict: 6 touches; 16 usable touches would do.");
  EXPECT_EQ(Headline(UnexplainedReport()),
            "The model is wrong in a way that no built-in effect explains. It depends on travel.");
  EXPECT_EQ(Headline(CompareReport()), "The model is off by 41.0 ms, 8.2 times the noise floor.");
  EXPECT_EQ(Headline(WithoutPosesReport()),
            "Measured and simulated touches differ as distributions (p = 0.0005).");
}

TEST(NothingMissing, IsANumberOrTheReasonWhyThereIsNone) {
  v1::Report report = AdequateReport();
  report.set_p_nothing_missing(0.31);
  report.set_hypotheses_tried(214);
  EXPECT_EQ(NothingMissingWords(report), "P(nothing is missing) = 0.31 over 214 hypotheses.");
  EXPECT_EQ(NothingMissingWords(CheckDataReport()),
            "P(nothing is missing) is not assessed: a mistake in the data comes first.");
  EXPECT_EQ(NothingMissingWords(TooLittleDataReport()),
            "P(nothing is missing) is not assessed: there is too little data.");
  EXPECT_EQ(NothingMissingWords(CompareReport()), "");
  report.clear_p_nothing_missing();
  report.add_data()->set_kind(v1::DataReport::PHOTOGRAPHS);
  EXPECT_EQ(
      NothingMissingWords(report),
      "P(nothing is missing) is not assessed: touches and photographs were diagnosed one by one, or the "
      "pictures are too few.");
  report.mutable_data()->DeleteSubrange(0, report.data_size() - 1);
  EXPECT_EQ(NothingMissingWords(report), "P(nothing is missing) is not assessed: the pictures are too few.");
}

// An effect of the catalogue that acts in one round: not "in a way that no built-in effect explains".
TEST(Headline, SaysThatRoundsDiffer) {
  v1::Report report = UnexplainedReport();
  report.mutable_data(0)->mutable_unexplained()->mutable_covariates(0)->set_name("round");
  EXPECT_EQ(Headline(report), "Something changed between the rounds of the session.");
  report.add_steps()->set_effect("tip_radius");
  EXPECT_EQ(Headline(report),
            "The model lacks tip_radius. Something changed between the rounds of the session.");
}

TEST(Headline, NamesWhatTheDataDoWithout) {
  v1::Report report;
  report.set_verdict(v1::Report::WRONG_VALUES);
  v1::DataReport* data = report.add_data();
  data->set_kind(v1::DataReport::TOUCHES);
  data->mutable_initial()->set_rmse(5000);
  data->mutable_final()->set_rmse(5000);
  EXPECT_EQ(Headline(report), "No effect is missing, but the noise is not what the model says.");
  report.add_superfluous("poll_interval");
  EXPECT_EQ(Headline(report), "No effect is missing, but the data do without poll_interval.");
}

TEST(Headline, OfAMapOfTheSurfaceSaysWhatItIsWorthOnUnseenTouches) {
  v1::Report report;
  report.set_verdict(v1::Report::MISSING_EFFECTS);
  report.add_steps()->set_effect("surface_map");
  v1::DataReport* data = report.add_data();
  data->set_kind(v1::DataReport::TOUCHES);
  data->mutable_initial()->set_rmse(5510);
  data->mutable_final()->set_rmse(4600);
  data->mutable_final()->set_heldout_rmse(5450);
  EXPECT_EQ(Headline(report),
            "The model lacks surface_map; on unseen touches the error falls from 5.51 ms to 5.45 ms.");
}

TEST(Headline, TellsOfDistributionsWithNoiseThatTheModelLacks) {
  v1::Report report = WithoutPosesReport();
  report.set_verdict(v1::Report::MISSING_EFFECTS);
  report.add_steps()->set_effect("gaussian_noise");
  report.mutable_data(0)->mutable_distributions()->set_p(0.4);
  EXPECT_EQ(Headline(report),
            "The model lacks gaussian_noise; with it, measured and simulated touches cannot be told apart as "
            "distributions (p = 0.40).");
}

TEST(OtherAmbiguities, LeaveOutWhatAStepSays) {
  v1::Report report = MissingEffectsReport();
  v1::Ambiguity* same = report.add_ambiguities();
  same->add_effects("surface_offset");
  same->add_effects("tip_radius");
  ASSERT_EQ(OtherAmbiguities(report).size(), 1u);
  EXPECT_EQ(OtherAmbiguities(report)[0]->effects(0), "channel_latency");
}

TEST(ToDecide, TakesSentencesAsTheyAre) {
  EXPECT_EQ(ToDecide("a second speed"), "To decide: a second speed");
  EXPECT_EQ(ToDecide("Touch at a second speed."), "Touch at a second speed.");
  EXPECT_EQ(ToDecide(""), "");
}

TEST(Ladder, RunsFromTheGivenModelToTheFloor) {
  std::vector<Rung> rungs = Ladder(MissingEffectsReport());
  ASSERT_EQ(rungs.size(), 4u);
  EXPECT_EQ(rungs[0].name, "nominal");
  EXPECT_EQ(rungs[1].name, "+ tip_radius or surface_offset");
  EXPECT_EQ(rungs[2].rmse, 5010);
  EXPECT_EQ(rungs[3].kind, Rung::kFloor);
  EXPECT_EQ(Ladder(WrongValuesReport())[1].kind, Rung::kRefit);
  EXPECT_EQ(Ladder(UnexplainedReport())[1].kind, Rung::kSuggestion);
  EXPECT_TRUE(Ladder(v1::Report()).empty());
}

TEST(JsonReport, HasTheKeysThatOthersRelyOn) {
  for (const NamedReport& sample : AllSampleReports()) {
    const auto text = JsonReport(sample.report);
    ASSERT_TRUE(text.ok()) << text.status();
    const nlohmann::json json = nlohmann::json::parse(*text);
    for (const char* key : {"verdict", "data_problems", "superfluous", "refitted", "steps", "data", "next"})
      EXPECT_TRUE(json.contains(key)) << sample.name << " " << key;
    EXPECT_EQ(json["data"].size(), sample.report.data().empty() ? 0u : 1u) << sample.name;
    for (const nlohmann::json& data : json["data"]) {
      for (const char* key : {"kind", "unit", "session", "emulated", "count", "noise_floor", "initial",
                              "after_step", "final", "where", "unexplained"})
        EXPECT_TRUE(data.contains(key)) << sample.name << " " << key;
      for (const char* key : {"rmse", "heldout_rmse", "lack_of_fit_p"}) {
        EXPECT_TRUE(data["initial"][key].is_number()) << sample.name << " " << key;
        EXPECT_TRUE(data["final"][key].is_number()) << sample.name << " " << key;
      }
      EXPECT_EQ(data["after_step"].size(), json["steps"].size());
      EXPECT_TRUE(data["unexplained"]["covariates"].is_array());
      EXPECT_TRUE(data["unexplained"]["formula"].is_string());
    }
  }
}

TEST(JsonReport, WritesStepsAsTheDesignShowsThem) {
  const nlohmann::json json = nlohmann::json::parse(*JsonReport(MissingEffectsReport()));
  EXPECT_EQ(json["verdict"], "MISSING_EFFECTS");
  EXPECT_EQ(json["data"][0]["kind"], "TOUCHES");
  EXPECT_EQ(json["data"][0]["count"], 960);
  const nlohmann::json& step = json["steps"][0];
  EXPECT_EQ(step["effect"], "tip_radius");
  EXPECT_EQ(step["equivalent"], nlohmann::json({"surface_offset"}));
  EXPECT_EQ(step["scope"]["kind"], "RIG");
  EXPECT_EQ(json["steps"][1]["equivalent"], nlohmann::json::array());
  EXPECT_EQ(step["parameters"][0]["name"], "radius_mm");
  EXPECT_DOUBLE_EQ(step["parameters"][0]["std_error"], 0.021);
  EXPECT_EQ(step["parameters"][0]["unit"], "mm");
}

TEST(JsonReport, IsValidJsonWhereNumbersAreNotKnown) {
  v1::Report report = MissingEffectsReport();
  report.mutable_data(0)->mutable_initial()->set_lack_of_fit_p(std::nan(""));
  const nlohmann::json json = nlohmann::json::parse(*JsonReport(report));
  EXPECT_EQ(json["data"][0]["initial"]["lack_of_fit_p"], "NaN");
}

TEST(Headline, OfAnAdequateModelNamesAFingerThatScattersOtherwise) {
  v1::Report report = AdequateReport();
  EXPECT_THAT(Headline(report), HasSubstr("Nothing is missing"));
  v1::FingerScatter& scatter = *report.mutable_data(0)->mutable_finger_scatter();
  scatter.set_finger("m");
  scatter.set_rmse(2500);
  scatter.set_others_rmse(5100);
  scatter.set_p(1e-12);
  EXPECT_THAT(Headline(report), Not(HasSubstr("Nothing is missing")));
  EXPECT_THAT(Headline(report), HasSubstr("2.50 ms on finger m and 5.10 ms on the others"));
}

TEST(TimesTheFloor, BlamesTheFileWhereTheFileIsWrong) {
  v1::Report report = CheckDataReport();
  EXPECT_THAT(TimesTheFloor(report), HasSubstr("the error is the file's but for 14.4 ms"));
  EXPECT_THAT(TimesTheFloor(report), Not(HasSubstr("the model's, not noise")));
  EXPECT_THAT(TimesTheFloor(MissingEffectsReport()), HasSubstr("is the model's, not noise"));
}

TEST(CovariateName, IsInWords) {
  EXPECT_EQ(CovariateName("session_time_s"), "session time");
  EXPECT_EQ(CovariateName("incidence_deg"), "incidence");
  EXPECT_EQ(CovariateName("approach_z"), "approach_z");
}

TEST(CountToVerdict, SaysHowManyAreNeeded) {
  v1::NextMeasurement touch, picture;
  touch.mutable_touch();
  picture.mutable_photograph();
  EXPECT_EQ(CountToVerdict(picture), "");
  picture.set_count_to_verdict(1);
  EXPECT_EQ(CountToVerdict(picture), "about 1 such picture to a verdict (6 nats)");
  picture.set_count_to_verdict(3);
  EXPECT_EQ(CountToVerdict(picture), "about 3 such pictures to a verdict (6 nats)");
  touch.set_count_to_verdict(9);
  EXPECT_EQ(CountToVerdict(touch), "about 9 such touches to a verdict (6 nats)");
}

TEST(ErrorScale, WritesErrorsInTheUnitOfTheKind) {
  v1::DataReport touches, photographs, boards;
  photographs.set_kind(v1::DataReport::PHOTOGRAPHS);
  boards.set_kind(v1::DataReport::BOARDS);
  EXPECT_EQ(ErrorScale(touches).Text(41000), "41.0 ms");
  EXPECT_EQ(ErrorScale(photographs).Text(12.34), "12.3 grey");
  EXPECT_EQ(ErrorScale(boards).Text(0.1234), "0.123 px");
  EXPECT_EQ(ErrorScale(photographs).Signed(3.2), "+3.20 grey");
  EXPECT_EQ(ErrorScale(boards).Change(1.234, 0.2), "1.23 -> 0.200 px");
  EXPECT_STREQ(ErrorScale(touches).readings(), "touches");
  EXPECT_STREQ(ErrorScale(boards).Counted(1), "picture");
}

}  // namespace
}  // namespace touchstone::client
