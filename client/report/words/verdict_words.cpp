// What a verdict rests on, in words: how far off the model is and whose error that is, fingers that differ, the place in
// the session.
#include <algorithm>
#include <cmath>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_replace.h>
#include <absl/strings/strip.h>

#include "client/report/words/error_scale.h"

namespace touchstone::client {

std::string CovariateName(const std::string& name) {
  if (name == "touch") return "the order of the touches";
  if (name == "touch_number") return "touch number";
  if (name == "first") return "which finger touches first";
  absl::string_view stem = name;
  for (const char* unit : {"_mm_s2", "_mm_s", "_per_m", "_mm", "_deg", "_us", "_s"})
    if (absl::ConsumeSuffix(&stem, unit)) break;
  // approach_z and what the user named (cov_*) stay as formulas have them.
  return stem.size() < name.size() ? absl::StrReplaceAll(stem, {{"_", " "}}) : name;
}

std::string TimesTheFloor(const v1::Report& report, const v1::DataReport& data) {
  const Floor floor = NoiseFloorOf(data);
  const ErrorScale scale(data);
  const double ratio = floor.sigma > 0 ? data.initial().rmse() / floor.sigma : 0;
  if (!(ratio > 0)) return "";
  if (AgreesToRounding(data)) return "which is the rounding of files and meshes";
  if (ratio <= 1.02)
    return report.verdict() == v1::Report::UNEXPLAINED ? "no more than the floor: what is unexplained "
                                                         "differs between repeats, and counts as noise here"
                                                       : "no more than the floor";
  const std::string times = absl::StrCat(Number(ratio, 2), " times the floor");
  const std::string share = absl::StrCat(floor.bound ? "at least " : "", Share(data.reducible_share()));
  if (report.verdict() == v1::Report::CHECK_DATA) {
    const bool ours = !report.data_problems().empty() && &DataOf(report, report.data_problems(0)) == &data;
    const double after = ours ? report.data_problems(0).error_after() : 0;
    return absl::StrCat(times, ", which says nothing of the model yet: the error is the file's",
                        after > 0 ? absl::StrCat(" but for ", scale.Text(after)) : "");
  }
  if (report.verdict() == v1::Report::TOO_LITTLE_DATA)
    return absl::StrCat(times, ", from so few ", scale.readings(), " a rough figure");
  const uint32_t aside = data.set_aside().outliers();
  if (aside > 0) {
    // The share is of the others, and so is this error.
    const double others = floor.sigma / std::sqrt(std::max(1 - data.reducible_share(), 1e-12));
    return absl::StrCat(times, " with the ", Count(aside), " set aside; without them ",
                        others <= 1.02 * floor.sigma ? "it is no more than the floor"
                                                     : absl::StrCat(scale.Text(others), ", of which ", share,
                                                                    " is the model's, not noise"));
  }
  return absl::StrCat(times, ": ", share, " of the error is the model's, not noise");
}

std::string FingerScatterWords(const v1::Report& report) {
  // Beside a rest that nothing explains, fingers differ anyway.
  if (report.verdict() == v1::Report::UNEXPLAINED) return "";
  for (const v1::DataReport& data : report.data()) {
    if (!data.has_finger_scatter()) continue;
    const v1::FingerScatter& scatter = data.finger_scatter();
    const ErrorScale scale(data);
    return absl::StrCat("the error that is left is ", scale.Text(scatter.rmse()), " on finger ",
                        scatter.finger(), " and ", scale.Text(scatter.others_rmse()),
                        " on the others: one noise for all fingers does not do that (p ",
                        Probability(scatter.p()), ")");
  }
  return "";
}

std::string FingerBiasWords(const v1::DataReport& data) {
  if (AgreesToRounding(data)) return "";
  std::vector<std::string> fingers;
  for (int i = 0; i < data.finger_bias_size(); ++i)
    fingers.push_back(absl::StrCat(i < data.fingers_size() ? data.fingers(i) : absl::StrCat(i), " ",
                                   ErrorScale(data).Signed(data.finger_bias(i))));
  return absl::StrJoin(fingers, ", ");
}

std::vector<const v1::CovariateCurve*> SessionCurves(const v1::DataReport& data) {
  std::vector<const v1::CovariateCurve*> curves;
  for (const v1::CovariateCurve& curve : data.curves())
    if (!curve.fingers().empty()) curves.push_back(&curve);
  return curves;
}

std::string NearestEffectWords(const v1::Unexplained& rest) {
  if (rest.nearest_effect().empty()) return "";
  const std::string cosine = absl::StrCat("cosine ", Fixed(rest.nearest_cosine(), 2));
  // Below it two thirds and more of the size are something else.
  constexpr double kAlike = 0.7;
  return rest.nearest_cosine() < kAlike
             ? absl::StrCat("nothing of the catalogue looks like it (the nearest is ", rest.nearest_effect(),
                            ", ", cosine, ")")
             : absl::StrCat("it looks most like ", rest.nearest_effect(), " (", cosine,
                            "; 1 would be the same)");
}

std::string RungName(const v1::Step& step) {
  if (step.equivalent_size() < 2) return StepName(step);
  return absl::StrCat(step.effect(), " or ", step.equivalent_size(), " others");
}

std::string CountToVerdict(const v1::NextMeasurement& next) {
  const uint32_t count = next.count_to_verdict();
  if (count == 0) return "";
  const char* what = next.has_photograph() ? "picture" : "touch";
  return absl::StrCat("about ", Count(count), " such ", what,
                      count == 1              ? ""
                      : next.has_photograph() ? "s"
                                              : "es",
                      " to a verdict (6 nats)");
}

}  // namespace touchstone::client
