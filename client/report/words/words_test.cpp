#include "client/report/words/words.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "client/report/report.h"
#include "client/report/sample_reports.h"
#include "client/report/words/error_scale.h"
#include "server/base/test_paths.h"

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

std::vector<Rung> LadderOf(const v1::Report& report) {
  return Ladder(report, MainData(report));
}

// What a rule makes of its arguments.
std::string Written(const std::string& rule, const std::vector<double>& arguments) {
  const std::vector<std::string> parts = absl::StrSplit(rule, ' ');
  const double first = arguments.at(0);
  v1::DataReport pictures, boards;
  pictures.set_kind(v1::DataReport::PHOTOGRAPHS);
  boards.set_kind(v1::DataReport::BOARDS);
  if (rule == "time") return Time(first);
  if (rule == "signed_time") return SignedTime(first);
  if (rule == "grey") return ErrorScale(pictures).Text(first);
  if (rule == "px") return ErrorScale(boards).Text(first);
  if (rule == "probability") return Probability(first);
  if (rule == "effect_probability") return EffectProbability(first);
  if (rule == "share") return Share(first);
  if (rule == "count") return Count(static_cast<uint64_t>(first));
  if (parts[0] == "size") return SizeInUnit(first, parts.at(1));
  if (parts[0] == "value") return ValueWithError(Value(first, arguments.at(1), parts.at(1).c_str()));
  if (parts[0] != "interval") return absl::StrCat("no rule ", rule);
  v1::ParameterValue interval = Value(first, 0, parts.at(1).c_str());
  interval.set_lower(first);
  interval.set_upper(arguments.at(1));
  return Interval(interval);
}

// The page's test reads the same file.
TEST(Words, WriteEveryCaseOfTheTableThatThePageReadsToo) {
  std::ifstream file(SourceDir() + "/client/report/words/word_cases.txt");
  std::set<std::string> rules;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    const std::vector<std::string> parts = absl::StrSplit(line, '|');
    ASSERT_EQ(parts.size(), 3u) << line;
    const std::string rule(absl::StripAsciiWhitespace(parts[0]));
    std::vector<double> arguments;
    for (const absl::string_view text : absl::StrSplit(absl::StripAsciiWhitespace(parts[1]), ' '))
      arguments.push_back(std::strtod(std::string(text).c_str(), nullptr));
    EXPECT_EQ(Written(rule, arguments), absl::StripAsciiWhitespace(parts[2])) << line;
    rules.insert(rule);
  }
  EXPECT_EQ(rules.size(), 17u) << "every rule has cases";
}

TEST(TimeChange, SharesOneUnit) {
  EXPECT_EQ(TimeChange(41000, 5000), "41.0 -> 5.0 ms");
  EXPECT_EQ(TimeChange(1200, 815), "1.20 -> 0.82 ms");
}

TEST(Headline, CountsEffectsThatAreTooManyToName) {
  v1::Report report = MissingEffectsReport();
  report.mutable_steps()->RemoveLast();
  for (const char* name : {"tool_tilt", "object_scale", "clock_skew"})
    report.mutable_steps(0)->add_equivalent(name);
  EXPECT_THAT(Headline(report), HasSubstr("The model lacks tip_radius or 4 others; with it"));
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
  report.set_verdict(v1::Report::UNEXPLAINED);
  EXPECT_EQ(NothingMissingWords(report),
            "P(nothing is missing) = 0.31 over 214 hypotheses, of which none is what the verdict rests on.");
  report.set_verdict(
      v1::Report::MISSING_EFFECTS);  // noise with a name, say, of which no hypothesis of the means is part
  EXPECT_EQ(NothingMissingWords(report),
            "P(nothing is missing) = 0.31 over 214 hypotheses, of which none is what the verdict rests on.");
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

// The kind: "no more than the floor" read as an all-clear where repeats hold what is unexplained.
TEST(TimesTheFloor, SaysWhereRepeatsHoldWhatIsUnexplained) {
  v1::Report report = UnexplainedReport();
  v1::DataReport* data = report.mutable_data(0);
  data->set_noise_floor(5000);
  data->mutable_initial()->set_rmse(5000);
  EXPECT_THAT(TimesTheFloor(report, *data), HasSubstr("differs between repeats, and counts as noise here"));
  report.set_verdict(v1::Report::ADEQUATE);
  EXPECT_EQ(TimesTheFloor(report, *data), "no more than the floor");
}

// An effect of the catalogue that acts in one round: not "in a way that no built-in effect explains".
TEST(Headline, SaysThatRoundsDiffer) {
  v1::Report report = UnexplainedReport();
  report.mutable_data(0)->mutable_unexplained()->mutable_covariates(0)->set_name("round");
  EXPECT_EQ(Headline(report), "Something changed between the rounds of the session.");
  v1::Step* step = report.add_steps();
  step->set_effect("tip_radius");
  step->set_probability(0.9);
  EXPECT_EQ(Headline(report),
            "The model lacks tip_radius. Something changed between the rounds of the session.");
}

// The kind: a step of probability 0.06 stood in "The model lacks".
TEST(Headline, AssertsBesideWhatHasNoNameOnlyWhatIsMoreProbableThanNot) {
  v1::Report report = UnexplainedReport();
  const auto add = [&report](const char* effect, double probability) {
    v1::Step* step = report.add_steps();
    step->set_effect(effect);
    step->set_probability(probability);
  };
  add("oblique_slip", 0.06);
  EXPECT_EQ(
      Headline(report),
      "The model is wrong in a way that no built-in effect explains; oblique_slip may stand in for a part of "
      "it. It depends on travel.");
  add("tip_radius", 0.86);
  EXPECT_EQ(
      Headline(report),
      "The model lacks tip_radius, and something more that no built-in effect explains; oblique_slip may "
      "stand in for a part of it. It depends on travel.");
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
  std::vector<Rung> rungs = LadderOf(MissingEffectsReport());
  ASSERT_EQ(rungs.size(), 4u);
  EXPECT_EQ(rungs[0].name, "nominal");
  EXPECT_EQ(rungs[1].name, "+ tip_radius or surface_offset");
  EXPECT_EQ(rungs[2].rmse, 5010);
  EXPECT_EQ(rungs[3].kind, Rung::kFloor);
  EXPECT_EQ(LadderOf(WrongValuesReport())[1].kind, Rung::kRefit);
  EXPECT_EQ(LadderOf(UnexplainedReport())[1].kind, Rung::kSuggestion);
  EXPECT_TRUE(LadderOf(v1::Report()).empty());
}

TEST(JsonReport, HasTheKeysThatOthersRelyOn) {
  for (const NamedReport& sample : AllSampleReports()) {
    const auto text = JsonReport(sample.report);
    ASSERT_TRUE(text.ok()) << text.status();
    const nlohmann::json json = nlohmann::json::parse(*text);
    for (const char* key : {"verdict", "data_problems", "superfluous", "refitted", "steps", "data", "next"})
      EXPECT_TRUE(json.contains(key)) << sample.name << " " << key;
    EXPECT_EQ(json["data"].size(), static_cast<size_t>(sample.report.data_size())) << sample.name;
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
  EXPECT_THAT(TimesTheFloor(report, report.data(0)), HasSubstr("the error is the file's but for 14.4 ms"));
  EXPECT_THAT(TimesTheFloor(report, report.data(0)), Not(HasSubstr("the model's, not noise")));
  const v1::Report missing = MissingEffectsReport();
  EXPECT_THAT(TimesTheFloor(missing, missing.data(0)), HasSubstr("is the model's, not noise"));
}

TEST(TimesTheFloor, GivesErrorAndShareOfTheSameRowsWhereSomeAreSetAside) {
  v1::Report report = MissingEffectsReport();
  v1::DataReport& data = *report.mutable_data(0);
  data.mutable_set_aside()->set_outliers(26);
  data.set_reducible_share(0);
  EXPECT_THAT(TimesTheFloor(report, report.data(0)),
              HasSubstr("with the 26 set aside; without them it is no more than the floor"));
  data.set_reducible_share(0.75);
  EXPECT_THAT(TimesTheFloor(report, report.data(0)),
              HasSubstr("; without them 10.0 ms, of which 75 % is the model's, not noise"));
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

TEST(WhatToTell, NamesWhatTheDiscriminatingMeasurementPartsAStepFrom) {
  v1::Report report = MissingEffectsReport();
  EXPECT_EQ(WhatToTell(report, report.steps(0)), "To tell tip_radius from surface_offset");
  EXPECT_EQ(WhatToTell(report, report.steps(1)), "To tell channel_latency from finger_length");
  report.clear_ambiguities();
  EXPECT_EQ(WhatToTell(report, report.steps(1)), "To tell channel_latency from a cause without a name");
}

TEST(JointReport, TellsOfBothKinds) {
  v1::Report report = JointReport();
  EXPECT_THAT(NoiseFloorSentences(report),
              HasSubstr(" Noise floor of the touches 5.00 ms (0.10 mm at 20 mm/s)"));
  EXPECT_THAT(NoiseFloorSentences(report),
              HasSubstr(" Noise floor of the pictures 1.43 grey (levels of 255)"));
  EXPECT_THAT(TimesTheFloor(report, report.data(0)), HasSubstr("8.2 times the floor"));
  EXPECT_THAT(TimesTheFloor(report, report.data(1)), HasSubstr("4.2 times the floor"));
  EXPECT_EQ(Ladder(report, report.data(0)).size(), Ladder(report, report.data(1)).size());
  report.clear_steps();
  report.set_verdict(v1::Report::ADEQUATE);
  EXPECT_THAT(Headline(report), HasSubstr("as good as 960 touches and 12 pictures can tell"));
  report.clear_verdict();
  EXPECT_THAT(
      Headline(report),
      HasSubstr("off by 41.0 ms on touches (8.2 times the noise floor) and 6.03 grey on pictures (4.2"));
}

}  // namespace
}  // namespace touchstone::client
