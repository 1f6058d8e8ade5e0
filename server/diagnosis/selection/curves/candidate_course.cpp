#include "server/diagnosis/selection/curves/candidate_course.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <string>
#include <vector>

#include "server/base/units.h"
#include "server/diagnosis/selection/curves/rules.h"
#include "server/model/finger_name.h"

namespace touchstone::diagnosis::selection {
namespace {

double WaveAt(const CandidateCourse& course, const SessionSlots& slots, double x) {
  return std::sin(2 * kPi * (x - slots.first()) / course.constant + course.phase);
}

// Touches have an order of their own where several sessions are one set.
std::string TouchWord(const SessionSlots& slots, int place) {
  if (!slots.InSessionOrder()) return absl::StrFormat("%.5g s of each session", slots.At(place));
  return absl::StrCat("touch ", slots.TouchNumber(place));
}

// "finger l travels 0.25 mm farther".
std::string ValuesInWords(const CandidateCourse& course) {
  const int fingers = static_cast<int>(course.values.size());
  const auto name = [&](int finger) { return model::FingerName(finger, fingers); };
  if (course.finger >= 0) {
    const double value = course.values[course.finger];
    return absl::StrFormat("finger %s travels %.2g mm %s", name(course.finger), std::abs(value),
                           value > 0 ? "farther" : "less far");
  }
  std::string words = "the fingers travel farther by";
  for (int i = 0; i < fingers; ++i)
    absl::StrAppendFormat(&words, "%s %s %.2g mm", i > 0 ? "," : "", name(i), course.values[i]);
  return words;
}

std::string Words(const CandidateCourse& course, const SessionSlots& slots, const CurveCovariate& covariate) {
  const std::string what = ValuesInWords(course);
  const char* unit = covariate.name == "session_time_s" ? "s" : "touches";
  switch (course.kind) {
    case CourseKind::kStep:
      return absl::StrCat("from ", TouchWord(slots, slots.Begin(course.begin)), " on ", what);
    case CourseKind::kStretch:
      return absl::StrCat("from ", TouchWord(slots, slots.Begin(course.begin)), " to ",
                          TouchWord(slots, slots.Begin(course.end) - 1), " ", what);
    case CourseKind::kConstant:
    case CourseKind::kLine:
      return what;
    case CourseKind::kWave:
      return absl::StrFormat("%s and back in waves with a period of %.3g %s", what, course.constant, unit);
    case CourseKind::kWarmUp:
      return absl::StrFormat("%s with a time constant of %.2g %s, and then no more", what, course.constant,
                             unit);
  }
  return what;
}

}  // namespace

double ShareAt(const CandidateCourse& course, const SessionSlots& slots, int place) {
  const double x = slots.At(place);
  switch (course.kind) {
    case CourseKind::kWarmUp:
      return 1 - std::exp(-std::max(x, 0.0) / course.constant);
    case CourseKind::kWave:
      return WaveAt(course, slots, x);
    case CourseKind::kLine:
      return x / slots.last();
    default:
      return 1;
  }
}

NamelessCurve CurveOf(const CandidateCourse& course, const SessionSlots& slots,
                      const CurveCovariate& covariate) {
  const int fingers = static_cast<int>(course.values.size());
  NamelessCurve curve;
  curve.covariate = covariate.name;
  curve.of_time = curve.per_finger = true;
  curve.effective_dof = course.finger >= 0 ? 1 : fingers - 1;
  std::vector<double> shares;
  const auto edge = [&](int place, bool rises) {
    curve.knots.push_back(slots.At(place - 1)), shares.push_back(rises ? 0 : 1);
    curve.knots.push_back(slots.At(place)), shares.push_back(rises ? 1 : 0);
  };
  if (course.kind == CourseKind::kWave) {
    const double step = course.constant / kCurveRules.knots_per_cycle;
    for (double x = slots.first(); x < slots.last() + step; x += step)
      curve.knots.push_back(x), shares.push_back(WaveAt(course, slots, x));
  } else if (course.kind == CourseKind::kWarmUp) {
    for (int j = 0; j <= kCurveRules.warm_up_knots; ++j) {
      // Even steps of what is left to rise, to three time constants; then one to the end.
      const double x = -course.constant * std::log(1 - 0.95 * j / kCurveRules.warm_up_knots);
      if (x >= slots.last()) break;
      curve.knots.push_back(x), shares.push_back(1 - std::exp(-x / course.constant));
    }
    curve.knots.push_back(slots.last()), shares.push_back(1 - std::exp(-slots.last() / course.constant));
  } else {
    edge(slots.Begin(course.begin), true);
    // One touch alone is a peak of three knots.
    if (course.end < slots.slots() && slots.Begin(course.end) - slots.Begin(course.begin) > 1)
      edge(slots.Begin(course.end), false);
    else if (course.end < slots.slots())
      curve.knots.push_back(slots.At(slots.Begin(course.end))), shares.push_back(0);
  }
  for (int i = 0; i < fingers; ++i) {
    curve.values.emplace_back();
    for (const double share : shares) curve.values.back().push_back(share * course.values[i]);
  }
  curve.words = Words(course, slots, covariate);
  return curve;
}

bool HasRisingKnots(const NamelessCurve& curve) {
  const std::vector<double>& knots = curve.knots;
  const double finest = 1e-5 * (knots.back() - knots.front());  // what a file keeps of them
  for (size_t j = 1; j < knots.size(); ++j)
    if (!(knots[j] - knots[j - 1] > finest)) return false;
  return true;
}

}  // namespace touchstone::diagnosis::selection
