#include "tests/hidden_effects/score/verify.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/status.h"

namespace touchstone::hidden {

constexpr uint64_t kFreshSeeds = 500'000, kCopySeeds = 700'000;

absl::StatusOr<double> FinalRmseFoundAgainUs(const Set& set, const v1::Report& report,
                                             const TestObjects& objects) {
  const std::string& saved = report.improved_model_yaml();
  TOUCHSTONE_ASSIGN_OR_RETURN(const diagnosis::DiagnosisInput input,
                              InputFor(set.csv, saved.empty() ? set.model_yaml : saved, objects));
  TOUCHSTONE_ASSIGN_OR_RETURN(const diagnosis::report::Diagnosis compared, diagnosis::Compare(input, {}));
  if (!compared.data[0].final) return absl::NotFoundError("no touch could be compared");
  return compared.data[0].final->rmse;
}

absl::StatusOr<double> FreshRmseUs(const Scenario& truth, uint64_t seed, const v1::Report& report,
                                   const TestObjects& objects) {
  return FinalRmseFoundAgainUs(Generate(truth, seed + kFreshSeeds), report, objects);
}

std::string WithEffect(const std::string& model_yaml, const std::string& effect_yaml) {
  const size_t list = effect_yaml.find("effects:");
  const std::string item =
      list == std::string::npos ? effect_yaml : effect_yaml.substr(effect_yaml.find('\n', list) + 1);
  std::string yaml = model_yaml;
  if (yaml.find("effects:") == std::string::npos) yaml += "effects:\n";
  const std::string indent = item.compare(0, 2, "  ") == 0 ? "" : "  ";
  for (size_t begin = 0; begin < item.size();) {
    const size_t end = std::min(item.find('\n', begin), item.size());
    if (end > begin) yaml += indent + item.substr(begin, end - begin) + "\n";
    begin = end + 1;
  }
  return yaml;
}

double CutsTo(const Scenario& truth, uint64_t seed, const std::string& effect_yaml,
              const TestObjects& objects) {
  if (effect_yaml.empty()) return NAN;
  const Set fresh = Generate(truth, seed + kFreshSeeds);
  const auto before = ExactRmseUs(fresh, fresh.model_yaml, objects),
             after = ExactRmseUs(fresh, WithEffect(fresh.model_yaml, effect_yaml), objects);
  if (!before.ok() || !after.ok()) return std::numeric_limits<double>::infinity();
  return *after * *after / (*before * *before);
}

std::optional<Scenario> FittedCopy(const Scenario& truth, const v1::Report& report) {
  if (truth.hidden.size() != 1 || report.steps_size() != 1) return std::nullopt;
  const v1::Step& step = report.steps(0);
  const Hidden& hidden = truth.hidden.front();
  if (step.effect() != hidden.effect || IsNoise(hidden.effect) || hidden.effect == "surface_error")
    return std::nullopt;
  if (step.parameters_size() != static_cast<int>(hidden.values.size())) return std::nullopt;
  Scenario copy = truth;
  copy.sigma_us = TouchEntry(report).noise_floor();
  // What the model claims stays as it was.
  if (copy.model_sigma_us == 0) copy.model_sigma_us = truth.sigma_us;
  for (size_t i = 0; i < hidden.values.size(); ++i)
    copy.hidden[0].values[i] = step.parameters(static_cast<int>(i)).value();
  return copy;
}

std::vector<Mark> CoverageOfCopies(const Arm& arm, const Scenario& truth, const v1::Report& report,
                                   uint64_t seed, int copies, const TestObjects& objects) {
  std::vector<Mark> marks;
  const std::optional<Scenario> copy = FittedCopy(truth, report);
  if (!copy) return marks;
  for (int k = 0; k < copies; ++k) {
    const auto input = InputFor(Generate(*copy, seed + kCopySeeds + static_cast<uint64_t>(k)), objects);
    if (!input.ok()) continue;
    const auto again = diagnosis::Diagnose(*input, {});
    if (!again.ok()) continue;
    for (const Mark& mark : Judge(arm, *copy, diagnosis::report::ToReport(*again), NAN))
      if (mark.measure == "interval covers") marks.push_back({kCopyCovers, mark.yes});
  }
  return marks;
}

}  // namespace touchstone::hidden
