#include "server/diagnosis/engine/search/set_aside.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/base/numbers/distributions.h"
#include "server/diagnosis/engine/search/rules.h"

namespace touchstone::diagnosis::engine {
namespace {

// Probability of at least `hits` of `drawn` measurements in a group of `group` among `all` (hypergeometric).
double AtLeast(int hits, int drawn, int group, int all) {
  const auto log_choose = [](int n, int k) {
    return std::lgamma(n + 1.0) - std::lgamma(k + 1.0) - std::lgamma(n - k + 1.0);
  };
  double p = 0;
  for (int k = hits; k <= std::min(drawn, group); ++k)
    if (drawn - k <= all - group)
      p += std::exp(log_choose(group, k) + log_choose(all - group, drawn - k) - log_choose(all, drawn));
  return std::min(p, 1.0);
}

// Probability of `count` or more where chance gives `mean` (Poisson).
double PoissonTail(int count, double mean) {
  double below = 0, term = std::exp(-mean);
  for (int k = 0; k < count; ++k) below += term, term *= mean / (k + 1);
  return std::max(1 - below, 0.0);
}

// Neighbours that are both set aside.
double NeighboursP(const std::vector<char>& aside, int count) {
  int pairs = 0;
  for (size_t i = 1; i < aside.size(); ++i) pairs += aside[i] && aside[i - 1];
  return PoissonTail(pairs, count * (count - 1.0) / static_cast<double>(aside.size()));
}

struct Shared {
  double p = 1;  // of the least likely, over all groups that were looked at
  std::string words;
};

// The groups that hold more of them than chance gives, over all groups that were looked at; of each division the one that is
// least likely.
Shared SharedGroups(const std::vector<char>& aside, const std::vector<Division>& divisions) {
  std::vector<std::pair<double, std::string>> shared;
  int looked_at = 0;
  for (const Division& division : divisions) {
    std::vector<int> all(division.groups.size()), set_aside(division.groups.size());
    int known = 0, known_aside = 0;
    for (size_t i = 0; i < aside.size(); ++i) {
      if (division.group[i] < 0) continue;
      ++known, ++all[division.group[i]];
      known_aside += aside[i], set_aside[division.group[i]] += aside[i];
    }
    if (division.groups.size() < 2) continue;
    std::pair<double, std::string> best = {1, ""};
    for (size_t g = 0; g < division.groups.size(); ++g) {
      ++looked_at;
      const double p = AtLeast(set_aside[g], known_aside, all[g], known);
      if (p < best.first) best = {p, absl::StrCat(set_aside[g], " of them are ", division.groups[g])};
    }
    shared.push_back(std::move(best));
  }
  std::sort(shared.begin(), shared.end());
  Shared all;
  for (const auto& [p, group] : shared) {
    all.p = std::min(all.p, p * looked_at);
    if (p * looked_at < kCandidateRules.together_p)
      absl::StrAppend(&all.words, all.words.empty() ? "" : ", ", group);
  }
  return all;
}

}  // namespace

SetAside AssessSetAside(const std::vector<char>& aside, const std::vector<Division>& divisions, double rmse,
                        double noise, const std::string& plural, int slips) {
  SetAside assessed;
  assessed.of = static_cast<int>(aside.size());
  assessed.count = static_cast<int>(std::count(aside.begin(), aside.end(), 1));
  if (assessed.count == 0) return assessed;
  const double share = static_cast<double>(assessed.count) / assessed.of;
  assessed.words = absl::StrFormat(
      "%d of %d %s (%.2g %%) were set aside, since the noise of the others does not "
      "explain them",
      assessed.count, assessed.of, plural, 100 * share);
  const Shared shared = SharedGroups(aside, divisions);
  const double neighbours_p = NeighboursP(aside, assessed.count);
  const bool single = assessed.count <= slips && share <= kCandidateRules.slips_share;
  const bool grouped = !shared.words.empty(), neighbours = neighbours_p < kCandidateRules.together_p;
  assessed.is_finding = share > kCandidateRules.few_share || grouped || neighbours ||
                        (!single && noise > 0 && rmse > kCandidateRules.far_above_noise * noise);
  if (assessed.is_finding) {
    const double far_off =
        noise > 0 ? ChiSquaredTail(assessed.of * rmse * rmse / (noise * noise), assessed.of) : 1;
    const double many = PoissonTail(assessed.count, kCandidateRules.beyond_noise_share * assessed.of);
    constexpr int kLookedAt = 4;
    assessed.p = std::min(kLookedAt * std::min({shared.p, neighbours_p, many, far_off}), 1.0);
  }
  absl::StrAppend(&assessed.words, grouped ? "; " + shared.words : "",
                  neighbours ? grouped ? ", and they follow one another" : "; they follow one another" : "",
                  !grouped && !neighbours ? "; nothing that they share was found" : "", ".");
  return assessed;
}

}  // namespace touchstone::diagnosis::engine
