#include "server/diagnosis/residuals/slices/covariates.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/random.h"
#include "server/base/units.h"

namespace touchstone::diagnosis::residuals {
namespace {

// Whether any two used touches differ in the covariate.
bool Varies(const touches::Observations& observations, const ResidualCovariate& covariate) {
  double min = INFINITY, max = -INFINITY;
  // Every touch of a small set; of a large one enough to see any difference that could matter.
  const int step = std::max(1, observations.size() / 20000);
  for (int k = 0; k < observations.size(); k += step) {
    if (!observations.used[k]) continue;
    for (int finger = 0; finger < observations.fingers; ++finger) {
      const double value = covariate.value(k, finger);
      if (std::isnan(value)) continue;
      min = std::min(min, value);
      max = std::max(max, value);
    }
  }
  return max - min > 1e-9 * std::max(std::abs(max), std::abs(min));
}

// Labels of every whole number from the lowest to the highest value; none if they are too many.
std::vector<std::string> Numbers(const std::vector<int>& values, int* lowest) {
  std::vector<std::string> labels;
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  *lowest = *low;
  if (*high - *low >= 200) return labels;  // no category that a person could picture
  for (int value = *low; value <= *high; ++value) labels.push_back(absl::StrCat(value));
  return labels;
}

}  // namespace

std::vector<ResidualCovariate> ListResidualCovariates(const touches::Observations& observations,
                                                      const touches::Prediction& prediction) {
  const session::MeasurementSet& set = *observations.set;
  const std::vector<int>& row = observations.row;
  const int fingers = observations.fingers;
  const size_t cells = static_cast<size_t>(observations.size()) * fingers;
  std::vector<ResidualCovariate> list;
  const auto add = [&list](const char* name, const char* words, const char* unit, auto value) {
    list.push_back({name, words, unit, {}, value});
  };
  const auto add_cell = [&](const char* name, const char* words, const char* unit,
                            const std::vector<double>& values, double factor) {
    if (values.size() == cells)
      add(name, words, unit,
          [&values, fingers, factor](int k, int i) { return factor * values[size_t(k) * fingers + i]; });
  };

  // What the model says about the contact.
  if (prediction.cos_incidence.size() == cells)
    add("incidence_deg", "incidence", "deg", [&prediction, fingers](int k, int i) {
      return std::acos(std::min(1.0, prediction.cos_incidence[size_t(k) * fingers + i])) / kRadiansPerDegree;
    });
  add_cell("travel_mm", "travel", "mm", prediction.travel_m, kMillimetresPerMetre);
  add_cell("curvature_per_m", "curvature", "1/m", prediction.curvature_per_m, 1);
  add_cell("previous_press_mm", "previous press", "mm", prediction.previous_press_m, kMillimetresPerMetre);
  static const char* const kContact[3][2] = {
      {"contact_x_mm", "contact x"}, {"contact_y_mm", "contact y"}, {"contact_z_mm", "contact z"}};
  if (prediction.contact_m.size() == cells)
    for (int axis = 0; axis < 3; ++axis)
      add(kContact[axis][0], kContact[axis][1], "mm", [&prediction, fingers, axis](int k, int i) {
        return kMillimetresPerMetre * prediction.contact_m[size_t(k) * fingers + i][axis];
      });
  if (fingers > 1 && prediction.first_finger.size() == size_t(observations.size())) {
    add("first", "first finger", "", [&prediction](int k, int i) {
      return prediction.first_finger[k] < 0 ? NAN : double(prediction.first_finger[k] == i);
    });
    list.back().labels = {"later finger", "first finger"};  // 1 for the first, as in formulas
  }

  // What was commanded.
  static const char* const kDirections[2][3] = {{"approach_x", "approach_y", "approach_z"},
                                                {"lateral_x", "lateral_y", "lateral_z"}};
  for (int axis = 0; axis < 3; ++axis)
    add(kDirections[0][axis], kDirections[0][axis], "",
        [&set, &row, axis](int k, int) { return set.approach[row[k]][axis]; });
  for (int axis = 0; axis < 3; ++axis)
    add(kDirections[1][axis], kDirections[1][axis], "",
        [&set, &row, axis](int k, int) { return set.lateral[row[k]][axis]; });
  add("speed_mm_s", "speed", "mm/s",
      [&set, &row](int k, int) { return kMillimetresPerMetre * set.speed_m_s[row[k]]; });

  // Where in the session, and what else was written down.
  if (set.has_session_time)
    add("session_time_s", "session time", "s",
        [&set, &row](int k, int) { return set.session_time_s[row[k]]; });
  if (set.has_session_time)
    add("pause_s", "pause since the touch before", "s",
        [&observations](int k, int) { return touches::PauseS(observations, k); });
  for (const auto& [name, values] : set.covariates) {
    const std::vector<double>& column = values;
    list.push_back({name, name, "", {}, [&column, &row](int k, int) { return column[row[k]]; }});
  }

  // Categories.
  add("object", "object", "", [&observations](int k, int) { return double(observations.object[k]); });
  list.back().labels = observations.objects;
  add("finger", "finger", "", [](int, int i) { return double(i); });
  for (int i = 0; i < fingers; ++i) list.back().labels.push_back(model::FingerName(i, fingers));
  for (const auto& [name, values] :
       {std::make_pair("face", &set.face), std::make_pair("round", &set.round)}) {
    if (values->empty()) continue;
    int lowest = 0;
    std::vector<std::string> labels = Numbers(*values, &lowest);
    const std::vector<int>& column = *values;
    add(name, name, "", [&column, &row, lowest](int k, int) { return double(column[row[k]] - lowest); });
    list.back().labels = std::move(labels);
  }

  list.erase(std::remove_if(list.begin(), list.end(),
                            [&](const ResidualCovariate& c) { return !Varies(observations, c); }),
             list.end());
  return list;
}

int FingersCompared(const touches::Observations& observations, const std::vector<double>& residuals, int k) {
  int count = 0;
  for (int i = 0; i < observations.fingers; ++i)
    count += !std::isnan(residuals[size_t(k) * observations.fingers + i]);
  return count;
}

std::vector<int> ThinnedTouches(const touches::Observations& observations,
                                const std::vector<double>& residuals, int limit) {
  std::vector<int> touches;
  for (int k = 0; k < observations.size(); ++k)
    if (observations.used[k] && FingersCompared(observations, residuals, k) > 1) touches.push_back(k);
  const double share = double(limit) / std::max<size_t>(1, touches.size());
  if (share >= 1) return touches;
  // A pose stays with all of its repeats or goes with them.
  touches.erase(std::remove_if(touches.begin(), touches.end(),
                               [&](int k) {
                                 const auto words =
                                     RandomBlock(0, RandomDomain::kDiagnosis, observations.pose[k], 1, 0);
                                 return UniformFromWord(words[0]) > share;
                               }),
                touches.end());
  return touches;
}

}  // namespace touchstone::diagnosis::residuals
