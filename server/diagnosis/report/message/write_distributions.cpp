// Distributions of a set without poses against the model's.
#include <algorithm>

#include "server/base/units.h"
#include "server/diagnosis/report/message/write_data_report.h"

namespace touchstone::diagnosis::report {

void WriteDistributions(const distributions::PoseFreeComparison& comparison,
                        v1::DistributionComparison* message) {
  message->set_energy_distance(Microseconds(comparison.energy_distance_s));
  message->set_p(comparison.energy_p_value);
  message->set_plan(comparison.plan);
  message->set_simulated_touches(static_cast<uint32_t>(comparison.simulated_touches));
  for (const distributions::StatisticComparison& statistic : comparison.statistics) {
    v1::StatisticTest* test = message->add_statistics();
    test->set_name(statistic.name);
    test->set_unit(statistic.unit);
    test->set_measured(statistic.measured);
    test->set_simulated(statistic.simulated);
    test->set_p(statistic.p_value);
  }
  const auto add_compatible = [message](const std::string& effect) {
    const auto& named = message->compatible_effects();
    if (std::count(named.begin(), named.end(), effect) == 0) message->add_compatible_effects(effect);
  };
  for (const distributions::CompatibleEffect& effect : comparison.compatible_effects)
    add_compatible(effect.effect);
  for (const distributions::RoundFinding& finding : comparison.findings) {
    v1::RepeatFinding* to = message->add_findings();
    static_assert(static_cast<int>(distributions::RoundFindingKind::kTicks) + 1 == v1::RepeatFinding::TICKS);
    to->set_kind(static_cast<v1::RepeatFinding::Kind>(static_cast<int>(finding.kind) + 1));
    to->set_p(finding.p_value);
    to->set_words(finding.words);
    for (const std::string& effect : finding.compatible) {
      to->add_compatible_effects(effect);
      add_compatible(effect);
    }
  }
}

}  // namespace touchstone::diagnosis::report
