// What nameless curves may follow.
#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/diagnosis/selection/curves/nameless_curve.h"

namespace touchstone::diagnosis::selection {
namespace {

// Whether any two used touches differ.
bool CovariateVaries(const touches::Observations& o, const CurveCovariate& covariate) {
  double min = INFINITY, max = -INFINITY;
  for (int k = 0; k < o.size(); ++k)
    for (int i = 0; o.used[k] && i < o.fingers; ++i) {
      const double value = covariate.value(k, i);
      if (std::isnan(value)) continue;
      min = std::min(min, value);
      max = std::max(max, value);
    }
  return max - min > 1e-6 * std::max(std::abs(max), std::abs(min));
}

}  // namespace

std::vector<CurveCovariate> ListCurveCovariates(const touches::Observations& o,
                                                const touches::Prediction& d) {
  const session::MeasurementSet& set = *o.set;
  const auto at = [&o](int k, int i) { return static_cast<size_t>(k) * o.fingers + i; };
  std::vector<CurveCovariate> list;
  // Time first: where curves gain alike the list's order decides.
  if (set.has_session_time)
    list.push_back({"session_time_s", false, true, [&](int k, int) { return set.session_time_s[o.row[k]]; }});
  // Across several sessions the time begins anew, and what goes on shows in the order of the touches.
  const bool several_sessions = std::count(o.previous.begin(), o.previous.end(), -1) > 1;
  if (!set.has_session_time || several_sessions)
    list.push_back({"touch", false, true, [](int k, int) { return double(k); }});
  if (set.has_session_time)
    list.push_back({"pause_s", false, false, [&o](int k, int) { return touches::PauseS(o, k); }});
  list.push_back({"incidence_deg", true, false, [&d, at](int k, int i) {
                    return std::acos(std::clamp(d.cos_incidence[at(k, i)], 0.0, 1.0)) / kRadiansPerDegree;
                  }});
  list.push_back({"travel_mm", true, false,
                  [&d, at](int k, int i) { return d.travel_m[at(k, i)] * kMillimetresPerMetre; }});
  if (!d.curvature_per_m.empty())
    list.push_back(
        {"curvature_per_m", true, false, [&d, at](int k, int i) { return d.curvature_per_m[at(k, i)]; }});
  list.push_back({"previous_press_mm", true, false,
                  [&d, at](int k, int i) { return d.previous_press_m[at(k, i)] * kMillimetresPerMetre; }});
  list.push_back({"speed_mm_s", false, false,
                  [&](int k, int) { return set.speed_m_s[o.row[k]] * kMillimetresPerMetre; }});
  list.push_back({"first", true, false, [&d](int k, int i) { return d.first_finger[k] == i ? 1.0 : 0.0; }});
  list.push_back(
      {"first_finger", false, false, [&](int k, int) { return d.first_finger[k] - 0.5 * (o.fingers - 1); }});
  for (int axis = 0; axis < 3; ++axis) {
    const std::string letter(1, "xyz"[axis]);
    list.push_back({"approach_" + letter, false, false,
                    [&set, &o, axis](int k, int) { return set.approach[o.row[k]][axis]; }});
    list.push_back({"lateral_" + letter, false, false,
                    [&set, &o, axis](int k, int) { return set.lateral[o.row[k]][axis]; }});
    list.push_back(
        {"normal_" + letter, true, false, [&d, at, axis](int k, int i) { return d.normal[at(k, i)][axis]; }});
    list.push_back({"contact_" + letter + "_mm", true, false, [&d, at, axis](int k, int i) {
                      return d.contact_m[at(k, i)][axis] * kMillimetresPerMetre;
                    }});
  }
  for (const auto& [name, column] : set.covariates) {
    const std::vector<double>* values = &column;
    list.push_back({name, false, false, [values, &o](int k, int) { return (*values)[o.row[k]]; }});
  }
  list.erase(std::remove_if(list.begin(), list.end(),
                            [&](const CurveCovariate& covariate) { return !CovariateVaries(o, covariate); }),
             list.end());
  return list;
}

}  // namespace touchstone::diagnosis::selection
