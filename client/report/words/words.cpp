#include "client/report/words/words.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <set>

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_replace.h>
#include <absl/strings/strip.h>

#include "client/report/words/error_scale.h"
#include "server/base/files/file_label.h"
#include "server/base/text/value_text.h"
#include "server/base/units.h"

namespace touchstone::client {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

}  // namespace

std::string Number(double value, int digits) {
  return RoundedNumber(value, digits);
}

std::string Fixed(double value, int decimals) {
  return FixedNumber(value, decimals);
}

std::string Tick(double value) {
  return RoundNumber(value);
}

std::string Count(uint64_t count) {
  std::string text = absl::StrCat(count);
  if (text.size() < 5) return text;
  for (int place = static_cast<int>(text.size()) - 3; place > 0; place -= 3) text.insert(place, " ");
  return text;
}

std::string Time(double us) {
  if (std::isnan(us)) return "n/a";
  const TimeUnit unit = UnitOfTime(us);
  return absl::StrCat(Number(us * unit.per_us), " ", unit.symbol);
}

std::string SignedTime(double us) {
  return absl::StrCat(us > 0 ? "+" : "", Time(us));
}

std::string TimeChange(double from_us, double to_us) {
  const TimeUnit unit = UnitOfTime(std::max(std::abs(from_us), std::abs(to_us)));
  const double from = from_us * unit.per_us, to = to_us * unit.per_us;
  const int decimals =
      std::min(2, std::max(DecimalsFor(std::max(from, to), 3), DecimalsFor(std::min(from, to), 2)));
  return absl::StrCat(Fixed(from, decimals), " -> ", Fixed(to, decimals), " ", unit.symbol);
}

std::string Probability(double p) {
  if (std::isnan(p)) return "n/a";
  if (p < 1e-15) return "< 1e-15";
  if (p < 1e-3) return Number(p, 1);
  return p > 0.995 ? "1.00" : Fixed(p, p < 0.1 ? 3 : 2);
}

std::string EffectProbability(double p) {
  if (std::isnan(p)) return "";
  return p < 0.005 ? "< 0.01" : p > 0.995 ? "> 0.99" : Fixed(p, 2);
}

std::string Share(double share) {
  if (std::isnan(share)) return "n/a";
  const double percent = 100 * share;
  return absl::StrCat(Fixed(percent, std::abs(percent) < 9.95 || (percent > 97 && percent < 99.95) ? 1 : 0),
                      " %");
}

std::string Covariate(const std::string& name, const std::string& unit) {
  if (unit.empty()) return name;
  // "incidence_deg" with unit "deg" is "incidence (deg)".
  static const std::pair<const char*, const char*> kSuffixes[] = {
      {"_mm_s2", "mm/s2"}, {"_mm_s", "mm/s"}, {"_per_m", "1/m"}, {"_mm", "mm"},
      {"_deg", "deg"},     {"_us", "us"},     {"_s", "s"}};
  absl::string_view stem = name;
  for (const auto& [suffix, symbol] : kSuffixes) {
    if (unit == symbol && absl::ConsumeSuffix(&stem, suffix)) break;
  }
  return absl::StrCat(absl::StrReplaceAll(stem, {{"_", " "}}), " (", unit, ")");
}

namespace {

// Of a value in the report's unit: what brings it into the unit for people, and that unit with its space; `size` of times decides.
struct ShownUnit {
  double scale = 1;
  std::string symbol;
};
ShownUnit UnitShown(double size, const std::string& unit) {
  if (unit == "us") return {UnitOfTime(size).per_us, absl::StrCat(" ", UnitOfTime(size).symbol)};
  return {1, unit.empty() ? "" : absl::StrCat(" ", unit)};
}

}  // namespace

std::string SizeInUnit(double value, const std::string& unit, int digits) {
  const ShownUnit shown = UnitShown(value, unit);
  return absl::StrCat(Number(value * shown.scale, digits), shown.symbol);
}

std::string ValueWithError(double value, double std_error, const std::string& unit) {
  const ShownUnit shown = UnitShown(std::max(std::abs(value), std_error), unit);
  return absl::StrCat(touchstone::ValueWithError(value * shown.scale, std_error * shown.scale), shown.symbol);
}

std::string ValueWithError(const v1::ParameterValue& value) {
  return ValueWithError(value.value(), value.std_error(), value.unit());
}

std::string Interval(const v1::ParameterValue& value) {
  if (!(value.lower() < value.upper())) return "";
  const ShownUnit shown = UnitShown(std::max(std::abs(value.lower()), std::abs(value.upper())), value.unit());
  const int decimals = DecimalsFor((value.upper() - value.lower()) * shown.scale, 2);
  return absl::StrCat(Fixed(value.lower() * shown.scale, decimals), " to ",
                      Fixed(value.upper() * shown.scale, decimals), shown.symbol);
}

std::string ParameterName(const v1::ParameterValue& value) {
  std::string name = value.name();
  if (!value.finger().empty()) {
    const bool axis = value.finger() == "x" || value.finger() == "y" || value.finger() == "z";
    absl::StrAppend(&name, axis ? " " : " of finger ", value.finger());
  }
  if (!value.object().empty()) absl::StrAppend(&name, ", ", value.object());
  return name;
}

std::string Join(const std::vector<std::string>& words, const std::string& last) {
  std::string text;
  for (size_t i = 0; i < words.size(); ++i) {
    if (i > 0) absl::StrAppend(&text, i + 1 == words.size() ? absl::StrCat(" ", last, " ") : ", ");
    absl::StrAppend(&text, words[i]);
  }
  return text;
}

std::string StepName(const v1::Step& step) {
  std::vector<std::string> names = {step.effect()};
  names.insert(names.end(), step.equivalent().begin(), step.equivalent().end());
  return Join(names, "or");
}

const v1::DataReport& MainData(const v1::Report& report) {
  const auto& data = report.data();
  // The model that is saved is that of the last session with enough touches.
  if (report.has_sessions())
    for (int s = data.size() - 1; s >= 0; --s)
      if (data[s].needed() == 0) return data[s];
  const auto pictures = std::find_if(data.begin(), data.end(), [](const v1::DataReport& one) {
    return one.kind() == v1::DataReport::PHOTOGRAPHS;
  });
  if (pictures != data.end()) return *pictures;
  return data.empty() ? v1::DataReport::default_instance() : data[0];
}

const v1::DataReport& DataOf(const v1::Report& report, const v1::DataProblem& problem) {
  const int index = static_cast<int>(problem.data_index());
  return index < report.data_size() ? report.data(index) : v1::DataReport::default_instance();
}

bool IsJoint(const v1::Report& report) {
  return report.data_size() > 1 && !report.has_sessions() &&
         std::all_of(report.data().begin(), report.data().end(),
                     [](const v1::DataReport& data) { return data.initial().rmse() > 0; });
}

std::string KindName(v1::DataReport::Kind kind) {
  std::string name = absl::AsciiStrToLower(v1::DataReport::Kind_Name(kind));
  if (!name.empty()) name[0] = absl::ascii_toupper(name[0]);
  return name;
}

namespace {

// Whether the noise was given with a plan: no touch has shown it.
bool IsNoiseOfPlan(const v1::DataReport& data) {
  return data.kind() == v1::DataReport::TOUCHES && !(data.initial().rmse() > 0) &&
         !data.noise().from_repeats() && data.noise().degrees_of_freedom() == 0 &&
         !data.noise().is_rounding();
}

}  // namespace

Floor NoiseFloorOf(const v1::DataReport& data) {
  return {data.noise_floor(), data.has_noise() && !data.noise().from_repeats() && !IsNoiseOfPlan(data)};
}

namespace {

// "5.00 ms (0.10 mm at 20 mm/s)", "2.10 grey (levels of 255)".
std::string FloorWithLength(const v1::DataReport& data) {
  const double us = data.noise_floor();
  const std::string text = ErrorScale(data).Text(us);
  if (data.kind() == v1::DataReport::PHOTOGRAPHS) return absl::StrCat(text, " (levels of 255)");
  if (data.kind() == v1::DataReport::BOARDS)
    return absl::StrCat(text, " (", Number(us / std::sqrt(2.0)), " px a coordinate)");
  const auto& speeds = data.set().speeds_mm_s();
  if (speeds.empty()) return text;
  const auto [slowest, fastest] = std::minmax_element(speeds.begin(), speeds.end());
  const std::string slow = Number(us * kSecondsPerMicrosecond * *slowest, 2),
                    fast = Number(us * kSecondsPerMicrosecond * *fastest, 2);
  if (*slowest == *fastest) return absl::StrCat(text, " (", slow, " mm at ", Tick(*slowest), " mm/s)");
  return absl::StrCat(text, " (", slow, " to ", fast, " mm at ", Tick(*slowest), " to ", Tick(*fastest),
                      " mm/s)");
}

}  // namespace

std::string NoiseFloorSentence(const v1::DataReport& data, const std::string& of) {
  const Floor floor = NoiseFloorOf(data);
  if (!(floor.sigma > 0)) return "";
  if (IsNoiseOfPlan(data)) return absl::StrCat(" Noise of one finger's time ", FloorWithLength(data), ".");
  const uint32_t repeats = data.set().repeats();
  return absl::StrCat(" Noise floor", of, " ", floor.bound ? "at most " : "", FloorWithLength(data),
                      data.noise().is_rounding()
                          ? ", what files and meshes are rounded to: the data scatter by less."
                      : floor.bound ? ", an upper bound without repeats."
                      : repeats > 0 ? absl::StrCat(", from ", Count(repeats), " repeats.")
                                    : ".");
}

std::string NoiseFloorSentences(const v1::Report& report) {
  if (!IsJoint(report)) return NoiseFloorSentence(MainData(report));
  std::string sentences;
  for (const v1::DataReport& data : report.data())
    sentences += NoiseFloorSentence(data, absl::StrCat(" of the ", ErrorScale(data).readings()));
  return sentences;
}

std::vector<Rung> Ladder(const v1::Report& report, const v1::DataReport& data) {
  std::vector<Rung> rungs;
  const ErrorScale scale(data);
  if (!(data.initial().rmse() > 0)) return rungs;
  const auto add = [&](Rung::Kind kind, std::string name, const v1::Quality& quality) {
    rungs.push_back({kind, std::move(name), quality.rmse(),
                     quality.heldout_rmse() > 0 ? quality.heldout_rmse() : kUnknown,
                     quality.lack_of_fit_p()});
  };
  const auto suggest = [&](Rung::Kind kind, std::string name, double rmse, double heldout) {
    rungs.push_back({kind, std::move(name), rmse, heldout > 0 ? heldout : kUnknown, kUnknown});
  };
  add(Rung::kGiven, report.model_name().empty() ? "given model" : report.model_name(), data.initial());
  if (report.steps().empty() && !report.refitted().empty())
    add(Rung::kRefit, "refitted values", data.final());
  for (int i = 0; i < std::min(report.steps_size(), data.after_step_size()); ++i)
    add(Rung::kStep, absl::StrCat("+ ", RungName(report.steps(i))), data.after_step(i));
  if (!report.data_problems().empty() && &DataOf(report, report.data_problems(0)) == &data &&
      report.data_problems(0).error_after() > 0)
    suggest(Rung::kSuggestion, absl::StrCat("with the ", scale.pictures() ? "set" : "file", " fixed"),
            report.data_problems(0).error_after(), kUnknown);
  const v1::Unexplained& rest = data.unexplained();
  if ((!rest.formula().empty() || !rest.lookup_yaml().empty()) && rest.rmse() > 0)
    suggest(Rung::kSuggestion, rest.formula().empty() ? "+ curve" : "+ suggested formula", rest.rmse(),
            rest.heldout_rmse());
  const Floor floor = NoiseFloorOf(data);
  if (floor.sigma > 0)
    suggest(Rung::kFloor, floor.bound ? "noise floor, at most" : "noise floor", floor.sigma, kUnknown);
  return rungs;
}

std::vector<const v1::Ambiguity*> OtherAmbiguities(const v1::Report& report) {
  std::set<std::set<std::string>> named;
  for (const v1::Step& step : report.steps()) {
    std::set<std::string> effects(step.equivalent().begin(), step.equivalent().end());
    effects.insert(step.effect());
    named.insert(effects);
  }
  std::vector<const v1::Ambiguity*> others;
  for (const v1::Ambiguity& ambiguity : report.ambiguities()) {
    const std::set<std::string> effects(ambiguity.effects().begin(), ambiguity.effects().end());
    if (effects.size() > 1 && named.insert(effects).second) others.push_back(&ambiguity);
  }
  return others;
}

std::string WhatToTell(const v1::Report& report, const v1::Step& step) {
  std::vector<std::string> others(step.equivalent().begin(), step.equivalent().end());
  for (const v1::Ambiguity& ambiguity : report.ambiguities()) {
    const auto& effects = ambiguity.effects();
    if (!step.equivalent().empty() ||
        std::find(effects.begin(), effects.end(), step.effect()) == effects.end())
      continue;
    for (const std::string& effect : effects)
      if (effect != step.effect() && std::find(others.begin(), others.end(), effect) == others.end())
        others.push_back(effect);
  }
  return absl::StrCat("To tell ", step.effect(), " from ",
                      others.empty() ? "a cause without a name" : Join(others, "or"));
}

std::string ToDecide(const std::string& discriminating_measurement) {
  if (discriminating_measurement.empty() || absl::ascii_isupper(discriminating_measurement[0]))
    return discriminating_measurement;
  return absl::StrCat("To decide: ", discriminating_measurement);
}

std::string SummaryToShow(const v1::Report& report) {
  // The first sentence is the headline.
  if (IsOfPlan(report))
    return report.summary().substr(std::min(FirstSentence(report).size() + 1, report.summary().size()));
  // Their own part says it at more length.
  if (!report.data_problems().empty()) return "";
  // Of boards it counts corners.
  const v1::DataReport& data = MainData(report);
  return data.initial().rmse() > 0 && data.kind() != v1::DataReport::BOARDS ? "" : report.summary();
}

std::string FirstSentence(const v1::Report& report) {
  return report.summary().substr(0, report.summary().find(". ") + 1);
}

bool IsOfPlan(const v1::Report& report) {
  return report.verdict() == v1::Report::VERDICT_UNSPECIFIED && !report.detectable().empty();
}

std::string SessionLabel(const v1::Report& report, int session) {
  std::vector<std::string> paths;
  for (const v1::DataReport& data : report.data()) paths.push_back(data.session());
  return FileLabel(paths, session);
}

std::string DataInWords(const v1::Report& report, const std::string& times) {
  std::string text;
  if (report.has_sessions()) {
    uint64_t touches = 0;
    for (const v1::DataReport& data : report.data()) touches += data.count();
    absl::StrAppend(&text, report.data_size(), " sessions, ", Count(touches), " touches");
  }
  for (const v1::DataReport& data : report.data())
    if (!report.has_sessions())
      absl::StrAppend(&text, text.empty() ? "" : " and ", Count(data.count()), " ",
                      ErrorScale(data).Counted(data.count()));
  if (report.data().empty()) return "0 touches";
  // Of a joint report the touches' set.
  const v1::DataSummary& set = report.data(0).set();
  if (set.objects_size() > 0)
    absl::StrAppend(&text, ", ", set.objects_size(), set.objects_size() == 1 ? " object" : " objects");
  if (set.poses() > 0)
    absl::StrAppend(&text, ", ", Count(set.poses()), set.poses() == 1 ? " pose" : " poses");
  if (set.poses() > 0 && set.rounds() > 1) absl::StrAppend(&text, " ", times, " ", set.rounds(), " rounds");
  return text;
}

}  // namespace touchstone::client
