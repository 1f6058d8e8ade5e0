#include "tests/hidden_effects/score/table.h"

#include <cstdio>
#include <vector>

#include "server/base/numbers/distributions.h"
#include "tests/hidden_effects/score/verify.h"

namespace touchstone::hidden {
namespace {

enum class Is { kAtMost, kAtLeast, kBetween, kReported };

struct Row {
  const char* arm;
  const char* measure;
  Is is;
  double target, upper;
};

constexpr Row kRows[] = {
    {"nothing", "false claim", Is::kAtMost, 0.01, 0},
    {"bumps of 0.25 sigma", "false claim", Is::kAtMost, 0.03, 0},
    {"bumps of 0.5 sigma", "false claim", Is::kAtMost, 0.03, 0},
    {"one weak", "right first", Is::kAtLeast, 0.95, 0},
    {"one weak", "truth named", Is::kAtLeast, 0.98, 0},
    {"one", "right first", Is::kAtLeast, 0.99, 0},
    {"one", "none added", Is::kReported, 0, 0},
    {"one", "rmse at the floor", Is::kAtLeast, 0.99, 0},
    {"one", "within 3 standard errors", Is::kAtLeast, 0.95, 0},
    {"one", "interval covers", Is::kBetween, 0.92, 0.98},
    {"one", kCopyCovers, Is::kBetween, 0.92, 0.98},
    {"two", "all found, none added", Is::kAtLeast, 0.90, 0},
    {"three", "all found, none added", Is::kAtLeast, 0.90, 0},
    {"five", "all found, none added", Is::kAtLeast, 0.90, 0},
    {"five, two speeds", "all found, none added", Is::kAtLeast, 0.90, 0},
    {"latency or length, one speed", "said so, with what decides", Is::kAtLeast, 1, 0},
    {"latency or length, two speeds", "right first", Is::kAtLeast, 1, 0},
    {"stretched time", "said so, with what decides", Is::kAtLeast, 1, 0},
    {"unlisted", "unexplained", Is::kAtLeast, 0.90, 0},
    {"unlisted", "right covariate first", Is::kAtLeast, 0.80, 0},
    {"unlisted", "formula halves the misfit", Is::kAtLeast, 0.60, 0},
    {"unlisted", "wrong name instead", Is::kAtMost, 0.05, 0},
    {"wrong value", "says wrong values", Is::kReported, 0, 0},
    {"wrong value", "value right", Is::kReported, 0, 0},
    {"noise missing", "noise named", Is::kAtLeast, 1, 0},
    {"noise missing", "noise within 5 %", Is::kAtLeast, 1, 0},
    {"noise missing", "histograms agree", Is::kReported, 0, 0},
    {"one object", "false claim", Is::kReported, 0, 0},
    {"one object", "right first", Is::kReported, 0, 0},
    {"one object", "none added", Is::kReported, 0, 0},
    {"48 touches", "false claim", Is::kReported, 0, 0},
    {"48 touches", "right first", Is::kReported, 0, 0},
    {"48 touches", "none added", Is::kReported, 0, 0},
    {"two speeds", "false claim", Is::kReported, 0, 0},
    {"two speeds", "right first", Is::kReported, 0, 0},
    {"two speeds", "none added", Is::kReported, 0, 0},
    {"20 % missing", "false claim", Is::kReported, 0, 0},
    {"20 % missing", "right first", Is::kReported, 0, 0},
    {"20 % missing", "none added", Is::kReported, 0, 0},
    {"2 % outliers", "false claim", Is::kReported, 0, 0},
    {"2 % outliers", "owns up to gross errors", Is::kAtLeast, 0.95, 0},
    {"2 % outliers", "right first", Is::kReported, 0, 0},
    {"2 % outliers", "none added", Is::kReported, 0, 0},
    {"no poses", "false detection", Is::kReported, 0, 0},
    {"no poses", "detects", Is::kReported, 0, 0},
    {"no poses", "names a culprit", Is::kAtMost, 0, 0},
};

std::string Percent(double share) {
  char text[32];
  snprintf(text, sizeof text, "%.3g", 100 * share);
  return text;
}

std::string TargetInWords(const Row& row) {
  switch (row.is) {
    case Is::kAtMost:
      return "<= " + Percent(row.target);
    case Is::kAtLeast:
      return ">= " + Percent(row.target);
    case Is::kBetween:
      return Percent(row.target) + " to " + Percent(row.upper);
    case Is::kReported:
      return "";
  }
  return "";
}

std::string Passed(const Row& row, double value) {
  switch (row.is) {
    case Is::kAtMost:
      return value <= row.target ? "pass" : "**miss**";
    case Is::kAtLeast:
      return value >= row.target ? "pass" : "**miss**";
    case Is::kBetween:
      return value >= row.target && value <= row.upper ? "pass" : "**miss**";
    case Is::kReported:
      return "";
  }
  return "";
}

std::string Of(const Rates& rates, const Row& row, const char* measure) {
  const auto found = rates.find({row.arm, measure});
  return found == rates.end() ? "" : Percent(found->second.Value());
}

}  // namespace

std::pair<double, double> Interval(const Rate& rate) {
  const double yes = rate.yes, no = rate.of - rate.yes;
  return {yes == 0 ? 0 : BetaQuantile(0.025, yes, no + 1), no == 0 ? 1 : BetaQuantile(0.975, yes + 1, no)};
}

std::string Table(const Results& results) {
  std::string out =
      "| arm | measure | target, % | sets | diagnose, % | 95 % interval | | forward BIC, % | RMSE drop, % | "
      "GP detects, % |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
  for (const Row& row : kRows) {
    const auto found = results.diagnosis.find({row.arm, row.measure});
    if (found == results.diagnosis.end()) continue;
    const Rate& rate = found->second;
    const auto [lower, upper] = Interval(rate);
    out += std::string("| ") + row.arm + " | " + row.measure + " | " + TargetInWords(row) + " | " +
           std::to_string(rate.of) + " | " + Percent(rate.Value()) + " | " + Percent(lower) + " - " +
           Percent(upper) + " | " + Passed(row, rate.Value()) + " | " + Of(results.bic, row, row.measure) +
           " | " + Of(results.rmse_drop, row, row.measure) + " | " + Of(results.gp, row, row.measure) +
           " |\n";
  }
  return out;
}

}  // namespace touchstone::hidden
