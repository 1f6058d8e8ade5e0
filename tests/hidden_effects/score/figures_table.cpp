#include "tests/hidden_effects/score/figures_table.h"

#include <cstdio>
#include <functional>
#include <optional>

namespace touchstone::hidden {
namespace {

constexpr double kMaxWrongPerArm = 0.02, kMaxWrongOverall = 0.005;
constexpr double kMedianSeconds = 2, kWorstSeconds = 20;

std::string Rounded(double value) {
  char text[32];
  snprintf(text, sizeof text, "%.3g", value);
  return text;
}

std::string PassOrMiss(bool pass) {
  return pass ? "pass" : "**miss**";
}

// "85 (62.1 - 96.8)"
std::string WithInterval(const Rate& rate) {
  if (rate.of == 0) return "";
  const auto [lower, upper] = Interval(rate);
  return Rounded(100 * rate.Value()) + " (" + Rounded(100 * lower) + " - " + Rounded(100 * upper) + ")";
}

Rate RateOf(const Rates& rates, const Arm& arm, const std::string& measure) {
  const auto found = rates.find({arm.name, measure});
  return found == rates.end() ? Rate{} : found->second;
}

// Over all arms that `takes_part`.
Rate Over(const Rates& rates, const std::string& measure, const std::function<bool(const Arm&)>& takes_part) {
  Rate sum;
  for (const Arm& arm : Arms()) {
    if (!takes_part(arm)) continue;
    const Rate rate = RateOf(rates, arm, measure);
    sum.yes += rate.yes, sum.of += rate.of;
  }
  return sum;
}

struct Line {
  std::string words;
  Rate rate;
  double target = 0;
  bool at_most = false;
};

std::string LineOf(const Line& line) {
  if (line.rate.of == 0) return "";
  const double value = line.rate.Value();
  const bool pass = line.at_most ? value <= line.target : value >= line.target;
  return "| " + line.words + " | " + (line.at_most ? "<= " : ">= ") + Rounded(100 * line.target) + " | " +
         std::to_string(line.rate.of) + " | " + WithInterval(line.rate) + " | " + PassOrMiss(pass) + " |\n";
}

std::string OverallLines(const Rates& rates) {
  const auto all = [](const Arm&) { return true; };
  const auto listed = [](const Arm& arm) { return arm.listed(); };
  const auto unlisted = [](const Arm& arm) { return !arm.listed(); };
  const auto data_error = [](const Arm& arm) { return arm.kind == Kind::kDataError; };
  const auto timed = [](const Arm& arm) { return arm.depends_on_time && arm.strength != Strength::kWeak; };
  const auto curve = [](const Arm& arm) { return !arm.listed() && arm.strength != Strength::kWeak; };
  const std::vector<Line> lines = {
      {"confidently wrong, everything", Over(rates, "confidently wrong", all), kMaxWrongOverall, true},
      {"confidently wrong, outside the catalogue", Over(rates, "confidently wrong", unlisted),
       kMaxWrongPerArm, true},
      {"confidently wrong, the catalogue's arms", Over(rates, "confidently wrong", listed), kMaxWrongOverall,
       true},
      {"data errors named", Over(rates, "right", data_error), 0.95, false},
      {"time-dependent causes unexplained, with time first (not weak)",
       Over(rates, "unexplained by time", timed), 0.90, false},
      {"lookup halves the misfit on fresh touches (not weak)", Over(rates, "lookup halves the misfit", curve),
       0.80, false},
      {"claims beyond 0.99 that are right", Over(rates, "claim beyond 0.99 right", all), 0.98, false},
      {"the same, outside the catalogue", Over(rates, "claim beyond 0.99 right", unlisted), 0.98, false},
      {"steps with a probability of 1.000", Over(rates, "probability of 1", all), 0, true},
      {"claimed falls of the error that Compare does not find", Over(rates, "fall not found again", all), 0,
       true},
      {"errors after a claimed fall within 10 % on fresh touches",
       Over(rates, "error on fresh touches as claimed", all), 0.98, false},
  };
  std::string out =
      "| over all arms | target, % | of | %, 95 % interval | |\n| --- | --- | --- | --- | --- |\n";
  for (const Line& line : lines) out += LineOf(line);
  return out;
}

std::string WorstArm(const Rates& rates) {
  int missed = 0, arms = 0;
  for (const Arm& arm : Arms()) {
    const Rate rate = RateOf(rates, arm, "confidently wrong");
    if (arm.listed() || rate.of == 0) continue;
    ++arms, missed += rate.Value() > kMaxWrongPerArm;
  }
  if (arms == 0) return "";
  return "\nConfidently wrong at most 2 % of the time on " + std::to_string(arms - missed) + " of " +
         std::to_string(arms) + " arms outside the catalogue: " + PassOrMiss(missed == 0) + ".\n";
}

std::string Durations(const TrialResult& result) {
  const auto& seconds = result.full_set_seconds;
  if (seconds.empty()) return "";
  const double median = seconds[seconds.size() / 2], worst = seconds.back();
  return "960 touches: " + Rounded(median) + " s of one core in the median (target <= 2, " +
         PassOrMiss(median <= kMedianSeconds) + "), " + Rounded(worst) + " s at worst (target <= 20, " +
         PassOrMiss(worst <= kWorstSeconds) + "); " + std::to_string(result.timed_out) +
         " sets had no report when the time was up.\n";
}

}  // namespace

std::string FiguresTable(const TrialResult& result) {
  const Rates& rates = result.results.diagnosis;
  std::string out =
      "| arm | sets | right, % | honest, % | confidently wrong, % | | lookup halves, % |\n"
      "| --- | --- | --- | --- | --- | --- | --- |\n";
  for (const Arm& arm : Arms()) {
    const Rate right = RateOf(rates, arm, "right"), honest = RateOf(rates, arm, "honest"),
               wrong = RateOf(rates, arm, "confidently wrong"),
               lookup = RateOf(rates, arm, "lookup halves the misfit");
    if (right.of == 0) continue;
    out += "| " + arm.name + " | " + std::to_string(right.of) + " | " + WithInterval(right) + " | " +
           WithInterval(honest) + " | " + WithInterval(wrong) + " | " +
           (arm.listed() ? "" : PassOrMiss(wrong.Value() <= kMaxWrongPerArm)) + " | " +
           (lookup.of == 0 ? "" : Rounded(100 * lookup.Value())) + " |\n";
  }
  return out + "\n" + OverallLines(rates) + WorstArm(rates) + Durations(result);
}

}  // namespace touchstone::hidden
