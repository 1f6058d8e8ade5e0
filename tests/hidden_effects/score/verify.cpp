#include "tests/hidden_effects/score/verify.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/status.h"
#include "server/base/units.h"

namespace touchstone::hidden {

constexpr uint64_t kFreshSeeds = 500'000;

absl::StatusOr<double> FinalRmseFoundAgainUs(const Set& set, const v1::Report& report,
                                             const TestObjects& objects) {
  const std::string& saved = report.improved_model_yaml();
  TOUCHSTONE_ASSIGN_OR_RETURN(const diagnosis::DiagnosisInput input,
                              InputFor(set.csv, saved.empty() ? set.model_yaml : saved, objects));
  TOUCHSTONE_ASSIGN_OR_RETURN(const diagnosis::report::Diagnosis compared, diagnosis::Compare(input, {}));
  if (!compared.final) return absl::NotFoundError("no touch could be compared");
  return compared.final->rmse_s * kMicrosecondsPerSecond;
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

}  // namespace touchstone::hidden
