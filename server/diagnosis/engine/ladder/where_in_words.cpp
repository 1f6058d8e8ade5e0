#include "server/diagnosis/engine/ladder/where_in_words.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/diagnosis/engine/ladder/rules.h"

namespace touchstone::diagnosis::engine {
namespace {

std::string Objects(const std::string& only, bool per_object) {
  if (!only.empty()) return absl::StrCat("on ", only, " only");
  return per_object ? "on each object in its own measure" : "on all objects alike";
}

// The one finger among at least three whose value differs while the others agree; empty: none.
std::string OnlyFinger(const std::vector<ParameterEstimate>& values) {
  const int count = static_cast<int>(values.size());
  std::string only;
  for (int i = 0; i < count; ++i) {
    double lowest = INFINITY, highest = -INFINITY, mean = 0, error = 0;
    for (int j = 0; j < count; ++j) {
      error = std::max(error, values[j].std_error);
      if (j == i) continue;
      lowest = std::min(lowest, values[j].value), highest = std::max(highest, values[j].value);
      mean += values[j].value / (count - 1);
    }
    const bool agree = highest - lowest <= kLadderRules.agree_errors * std::sqrt(2.0) * error;
    if (!agree || !(std::abs(values[i].value - mean) > kLadderRules.differ_errors * error)) continue;
    if (!only.empty()) return "";
    only = values[i].entry;
  }
  return only;
}

// Of an effect with one value per finger, the same on all objects.
std::string FingerInWords(const Fit& fit, int index) {
  const model::EffectInstance& instance = fit.model.base().effects[index];
  const std::vector<model::ParameterInfo>& parameters = instance.effect->parameters;
  if (instance.per_object || parameters.size() != 1 || !parameters[0].sum_zero ||
      fit.model.base().fingers < 3)
    return "";
  const std::string only = OnlyFinger(fit.model.Describe(index, fit.point, fit.covariance));
  return only.empty() ? ""
                      : absl::StrCat("Acts on finger ", only, " only: the others agree within their errors.");
}

}  // namespace

std::string WhereInWords(const Fit& fit, const SelectedStep& step) {
  const model::EffectInstance& instance = fit.model.base().effects[step.effect];
  const std::string object = fit.model.OnlyObject(step.effect), own = NameOf(*instance.effect);
  std::vector<std::string> places = {Objects(object, instance.per_object)};
  for (const CompetingEffect& other : step.competing)
    if (other.name == own && other.object != object && other.equivalent)
      places.push_back(Objects(other.object, other.per_object));
  if (places.size() == 1 && !instance.per_object) return FingerInWords(fit, step.effect);
  return absl::StrCat("Acts ", absl::StrJoin(places, ", or "),
                      places.size() > 1 ? ": these data cannot tell." : ".");
}

}  // namespace touchstone::diagnosis::engine
