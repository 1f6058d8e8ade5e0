#include "server/diagnosis/selection/curves/term_factors.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/diagnosis/selection/curves/rules.h"

namespace touchstone::diagnosis::selection {
namespace {

double ThreeDigits(double value) {
  if (value == 0) return 0;
  const double unit = std::pow(10.0, std::floor(std::log10(std::abs(value))) - 2);
  return unit >= 1 ? std::round(value / unit) * unit : std::round(value / unit) / std::round(1 / unit);
}

// Of the incidence of each finger's contact, up to where a contact is hardly one.
double TangentOfIncidence(const touches::Prediction& d, size_t e) {
  const double cosine = std::clamp(d.cos_incidence[e], 0.1, 1.0);
  return std::sqrt(1 / (cosine * cosine) - 1);
}
constexpr char kTangent[] = "tan(incidence_deg*pi/180)";

}  // namespace

std::vector<TermFactor> ListTermFactors(const touches::Observations& o, const touches::Prediction& d) {
  std::vector<TermFactor> factors;
  const session::MeasurementSet& set = *o.set;
  const auto at = [&o](int k, int i) { return static_cast<size_t>(k) * o.fingers + i; };
  const auto add = [&](const std::string& covariate, const std::string& expression, bool differs,
                       double penalty_nats, TermValue value) {
    factors.push_back({covariate, expression, differs, penalty_nats, std::move(value)});
  };
  const auto with_square = [&](const std::string& name, bool differs, const TermValue& value) {
    add(name, name, differs, kCurveRules.simple, value);
    add(name, name + "^2", differs, kCurveRules.curved, [value](int k, int i) {
      const double x = value(k, i);
      return x * x;
    });
  };

  for (int axis = 0; axis < 3; ++axis) {
    const std::string letter(1, "xyz"[axis]);
    with_square("approach_" + letter, false, [&, axis](int k, int) { return set.approach[o.row[k]][axis]; });
    with_square("lateral_" + letter, false, [&, axis](int k, int) { return set.lateral[o.row[k]][axis]; });
    with_square("normal_" + letter, true, [&d, at, axis](int k, int i) { return d.normal[at(k, i)][axis]; });
    const TermValue contact_mm = [&d, at, axis](int k, int i) {
      return d.contact_m[at(k, i)][axis] * kMillimetresPerMetre;
    };
    with_square("contact_" + letter + "_mm", true, contact_mm);
  }

  // Travel, about its middle where it is squared: far from zero a square is all but a line.
  double mean_mm = 0;
  int counted = 0;
  for (const double travel : d.travel_m)
    if (!std::isnan(travel)) mean_mm += travel * kMillimetresPerMetre, ++counted;
  mean_mm = std::round(mean_mm / std::max(counted, 1));
  const TermValue travel_mm = [&d, at](int k, int i) { return d.travel_m[at(k, i)] * kMillimetresPerMetre; };
  add("travel_mm", "travel_mm", true, kCurveRules.simple, travel_mm);
  add("travel_mm", absl::StrCat("(travel_mm - ", ShortestNumber(mean_mm), ")^2"), true, kCurveRules.curved,
      [travel_mm, mean_mm](int k, int i) { return std::pow(travel_mm(k, i) - mean_mm, 2); });
  add("travel_mm", absl::StrCat("abs(travel_mm - ", ShortestNumber(mean_mm), ")"), true, kCurveRules.curved,
      [travel_mm, mean_mm](int k, int i) { return std::abs(travel_mm(k, i) - mean_mm); });

  const TermValue cosine = [&d, at](int k, int i) { return std::clamp(d.cos_incidence[at(k, i)], 0.1, 1.0); };
  const TermValue tangent = [&d, at](int k, int i) { return TangentOfIncidence(d, at(k, i)); };
  add("incidence_deg", kTangent, true, kCurveRules.simple, tangent);
  add("incidence_deg", absl::StrCat(kTangent, "^2"), true, kCurveRules.simple,
      [tangent](int k, int i) { return std::pow(tangent(k, i), 2); });
  add("incidence_deg", "(1/cos(incidence_deg*pi/180) - 1)", true, kCurveRules.curved,
      [cosine](int k, int i) { return 1 / cosine(k, i) - 1; });
  add("incidence_deg", "incidence_deg", true, kCurveRules.simple,
      [cosine](int k, int i) { return std::acos(cosine(k, i)) * 180 / kPi; });
  add("incidence_deg", "sin(incidence_deg*pi/180)", true, kCurveRules.simple,
      [cosine](int k, int i) { return std::sqrt(1 - std::pow(cosine(k, i), 2)); });
  if (!d.curvature_per_m.empty())
    with_square("curvature_per_m", true, [&d, at](int k, int i) { return d.curvature_per_m[at(k, i)]; });

  // Pauses, about their mean: what they do is put to zero somewhere in the middle.
  const auto add_pause = [&] {
    double sum = 0, min = INFINITY, max = 0;
    for (int k = 0; k < o.size(); ++k) {
      const double pause_s = touches::PauseS(o, k);
      sum += pause_s, min = std::min(min, pause_s), max = std::max(max, pause_s);
    }
    const double mean = ThreeDigits(sum / std::max(o.size(), 1));
    if (!(max > min) || mean == 0) return;
    add("pause_s", absl::StrCat("(pause_s - ", ShortestNumber(mean), ")"), false, kCurveRules.simple,
        [&o, mean](int k, int) { return touches::PauseS(o, k) - mean; });
  };

  // What happens only when a certain finger is first.
  const double middle = 0.5 * (o.fingers - 1);
  for (int finger = 0; finger < o.fingers; ++finger)
    add("first_finger", absl::StrCat("(first_finger == ", ShortestNumber(finger - middle), ")"), false,
        kCurveRules.simple, [&d, finger](int k, int) { return d.first_finger[k] == finger ? 1.0 : 0.0; });
  add("first_finger", "first_finger", false, kCurveRules.simple,
      [&d, middle](int k, int) { return d.first_finger[k] - middle; });
  if (set.has_session_time) add_pause();
  with_square("previous_press_mm", true,
              [&d, at](int k, int i) { return d.previous_press_m[at(k, i)] * kMillimetresPerMetre; });
  const auto varies = [&](const std::vector<double>& column) {
    return !column.empty() &&
           *std::max_element(column.begin(), column.end()) > *std::min_element(column.begin(), column.end());
  };
  if (varies(set.speed_m_s)) {
    const TermValue speed_mm_s = [&](int k, int) { return set.speed_m_s[o.row[k]] * kMillimetresPerMetre; };
    with_square("speed_mm_s", false, speed_mm_s);
    add("speed_mm_s", "1/speed_mm_s", false, kCurveRules.simple,
        [speed_mm_s](int k, int i) { return 1 / speed_mm_s(k, i); });
  }
  // Conditions stand far from zero, and their effect was put to zero somewhere in the middle.
  const auto centred = [&](const std::string& name, const std::vector<double>& column) {
    if (!varies(column)) return;
    double sum = 0;
    for (const double x : column) sum += x;
    const double mean = ThreeDigits(sum / static_cast<double>(column.size()));
    const std::string text =
        absl::StrCat("(", name, mean < 0 ? " + " : " - ", ShortestNumber(std::abs(mean)), ")");
    const std::vector<double>* values = &column;
    const TermValue plain = [&o, values](int k, int) { return (*values)[o.row[k]]; };
    const TermValue shifted = [plain, mean](int k, int i) { return plain(k, i) - mean; };
    add(name, name, false, kCurveRules.simple, plain);
    if (mean == 0) return;
    add(name, text, false, kCurveRules.simple, shifted);
    add(name, text + "^2", false, kCurveRules.curved,
        [shifted](int k, int i) { return shifted(k, i) * shifted(k, i); });
  };
  if (set.has_session_time) centred("session_time_s", set.session_time_s);
  for (const auto& [name, column] : set.covariates) centred(name, column);
  return factors;
}

std::vector<FingerFactor> ListFingerFactors(const touches::Observations& o, const touches::Prediction& d) {
  std::vector<FingerFactor> factors;
  const double middle = 0.5 * (o.fingers - 1);
  factors.push_back({"", [](int, int) { return 1.0; }});
  factors.push_back({"finger", [middle](int, int i) { return i - middle; }});
  for (int finger = 0; finger < o.fingers; ++finger)
    factors.push_back({absl::StrCat("(finger == ", ShortestNumber(finger - middle), ")"),
                       [finger](int, int i) { return i == finger ? 1.0 : 0.0; }});
  if (o.fingers > 3)
    factors.push_back({"finger^2", [middle](int, int i) { return (i - middle) * (i - middle); }});
  factors.push_back({"first", [&d](int k, int i) { return d.first_finger[k] == i ? 1.0 : 0.0; }});
  // A slip that depends on something.
  factors.push_back({kTangent, [&o, &d](int k, int i) {
                       return TangentOfIncidence(d, static_cast<size_t>(k) * o.fingers + i);
                     }});
  return factors;
}

}  // namespace touchstone::diagnosis::selection
