// What a rehearsal hides in the user's own plan, and how well a diagnosis of it does.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include "client/cli/common/common.h"

#include "server/model/model.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::cli {

// What is hidden: nothing, an effect, two, a cause of no catalogue ("outside"), a mistake of the file ("mistake"). In every
// session of a set, or in the last one alone: then it has changed.
struct RehearsedCase {
  std::string
      name;  // "nothing", "tip_radius", "tip_radius+gravity_sag", "outside", "mistake", "tip_radius changed"
  std::vector<std::string> effects;  // of the catalogue that are hidden
  model::Model model;                // that touches
  bool is_outside = false;
  bool is_mistake = false;  // two fingers are exchanged in the file
  bool last_only = false;   // hidden in the last session alone; so is every mistake
  model::Model given = {};  // that is diagnosed
  double predicted = -1;    // chance that a check gives for the effect to be found; < 0: none

  bool IsHiddenIn(int session, int sessions) const { return !last_only || session == sessions - 1; }
  const model::Model& ModelOf(int session, int sessions) const {
    return IsHiddenIn(session, sessions) ? model : given;
  }
};

// How large a hidden effect is: so many times what rigs usually show, or where a check says that it is found in 80 %.
struct HiddenSize {
  double times_typical = 1;
  bool found = false;
};

// Of the given model: nothing, every effect of `check`.detectable (its first value alone, the others change nothing), as many
// pairs as `pairs` (drawn by `seed`), outside, mistake; of several sessions also every effect in the last alone. `only`: names of the effects; empty: all. Errors: a name that the
// check has not.
absl::StatusOr<std::vector<RehearsedCase>> ListCases(const model::Model& given, const v1::Report& check,
                                                     const HiddenSize& size,
                                                     const std::vector<std::string>& only, int pairs,
                                                     uint64_t seed, int sessions = 1);

// One diagnosed set.
struct RehearsedSet {
  std::string name;    // of the case
  bool found = false;  // every hidden effect is named, alone or among equivalents
  bool right =
      false;  // that, and nothing else; ADEQUATE of nothing; CHECK_DATA of a mistake; UNEXPLAINED of what is
              // outside
  // A step without a hidden effect; of several sessions a change that was not hidden; UNEXPLAINED where all that is hidden
  // has a name, and WRONG_VALUES of nothing.
  bool false_claim = false;
  bool confident = false;  // ... with a probability of at least 0.9, or CHECK_DATA without a mistake
  std::vector<double> z;   // (estimate - truth) / standard error of hidden values that were fitted
  bool left_out = false;   // it could not be hidden: nothing else is known
  bool honest() const { return !false_claim && !confident; }
};
RehearsedSet Assess(const RehearsedCase& hidden, const v1::Report& report);

Json ToJson(const RehearsedSet& set);
// Error: what stands there is no set of a rehearsal.
absl::StatusOr<RehearsedSet> SetFromJson(const Json& json);

// Shares with 95 % intervals (Clopper and Pearson), and what the z scores of hidden values say.
struct RehearsalRow {
  std::string name;
  int sets = 0, found = 0, right = 0, honest = 0, confident = 0;
  double predicted = -1;
  int values = 0, covered = 0;      // of 95 % intervals
  double mean_z = 0, spread_z = 0;  // 0 and 1 where values and errors are right
};
struct Interval95 {
  double lower = 0, upper = 1;
};
Interval95 IntervalOf(int count, int of);
// One row per case, in their order, then "all".
std::vector<RehearsalRow> Summarise(const std::vector<RehearsedCase>& cases,
                                    const std::vector<RehearsedSet>& sets);

}  // namespace touchstone::cli
