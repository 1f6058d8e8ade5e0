#include "server/diagnosis/report/words/distributions_summary.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include "server/base/text/readable_time.h"

namespace touchstone::diagnosis::report {
namespace {

using distributions::NoiseChange;

// "Repeats of ... (p 3e-12). Compatible effects: a, b. "
std::string FindingsInWords(const std::vector<distributions::RoundFinding>& findings) {
  std::string words;
  for (const distributions::RoundFinding& finding : findings)
    absl::StrAppend(&words, finding.words, " ",
                    finding.p_value < 1e-15 ? "p < 1e-15." : absl::StrFormat("p = %.1g.", finding.p_value),
                    finding.compatible.empty()
                        ? ""
                        : absl::StrCat(" In the catalogue ", absl::StrJoin(finding.compatible, ", "),
                                       " would do that; which it is, if it is one, these data cannot tell."),
                    " ");
  return words;
}

std::string NoiseChangeInWords(const distributions::PoseFreeComparison& comparison) {
  if (comparison.noise_change == NoiseChange::kNone) return "";
  return absl::StrCat("Rounds of the same poses scatter by ", TimeInWords(comparison.noise->sigma_s),
                      comparison.noise_change == NoiseChange::kNewEffect
                          ? " per finger; the model has no noise. "
                          : " per finger, not as the model says. ");
}

std::string CompatibleEffectsInWords(const std::vector<distributions::CompatibleEffect>& compatible) {
  std::vector<std::string> words;
  for (const distributions::CompatibleEffect& effect : compatible)
    words.push_back(absl::StrCat(effect.effect, " (", effect.values, ")"));
  if (words.empty())
    return "No single effect of the catalogue would make them alike: there may be several, or another "
           "protocol or speed. ";
  if (words.size() == 1)
    return absl::StrCat("The only compatible effect of the catalogue is ", words[0],
                        "; that is no proof: several at once, another protocol or speed may do the same. ");
  return absl::StrCat("Compatible effects are ", absl::StrJoin(words, ", "),
                      "; which of them it is, if it is one, times alone cannot tell. ");
}

}  // namespace

std::string SummarizeDistributions(const Diagnosis& diagnosis) {
  const distributions::PoseFreeComparison& comparison = *diagnosis.data[0].distributions;
  const std::string p = absl::StrFormat("(p = %.2g)", comparison.p_value);
  if (!comparison.diagnosed)
    return absl::StrCat("As distributions, the measured times ",
                        comparison.compatible ? "do not differ" : "differ", " from the model's ", p, ".");
  constexpr char kWriteDown[] = "To know more, write down the poses of the touches.";
  const std::string noise = NoiseChangeInWords(comparison), findings = FindingsInWords(comparison.findings);
  if (!comparison.compatible)
    return absl::StrCat(noise, findings, "As distributions, the measured times differ from the model's ", p,
                        ". ", CompatibleEffectsInWords(comparison.compatible_effects), kWriteDown);
  if (!comparison.findings.empty())
    return absl::StrCat(noise, findings, "As distributions, the times do not differ from the model's ", p,
                        ". ", kWriteDown);
  return absl::StrCat(noise, "As distributions, the measured times and those of the model ",
                      comparison.noise_change == NoiseChange::kNone ? "" : "with that noise ",
                      "do not differ ", p, ". That says little: without poses only large errors show.");
}

}  // namespace touchstone::diagnosis::report
