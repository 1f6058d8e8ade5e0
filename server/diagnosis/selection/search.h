// The search for what is missing: effects are added, values set free, taken back and exchanged, as long as
// the evidence grows by enough that chance would not do it in one set of a hundred.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/inference/fit.h"
#include "server/diagnosis/selection/candidates.h"

namespace touchstone {

// Thresholds, chosen on the tuning seeds of tests/hidden_effects.
struct SearchRules {
  double enter_nats = 4.5;      // gain in log evidence that a step needs
  double family_wise_p = 2e-3;  // of the likelihood ratio, over all moves
  double practical = 0.003;     // share by which the error on touches left out must fall
  double equivalent_nats = 3;   // explanations as near as this are named together
  double formula_nats = 11;     // price of a term that was picked from a dictionary
  int min_rows_a_value = 8;     // contrasts that each fitted value needs
  int max_steps = 6;
  int max_refits = 6;  // candidates that are fitted in full a step
};

// One way on from a fit.
struct Move {
  int candidate = -1;    // index into the candidates; -1: sets an effect of the model free
  std::string name;      // of the effect
  bool visible = false;  // false: this experiment cannot see it
  double evidence = 0;   // linear prediction, nats
  FreeModel start;
};

// One alternative to a step, fitted.
struct Alternative {
  std::string name;
  bool per_object = false;
  Fit fit;
};

struct Explanation {
  Fit fit;
  int given = 0;  // effects below this index are the given model's
};

class Search {
 public:
  Search(const Experiment& experiment, std::vector<Candidate> candidates, SearchRules rules,
         std::function<void(const std::string&)> progress)
      : experiment_(experiment),
        candidates_(std::move(candidates)),
        rules_(rules),
        progress_(std::move(progress)) {}

  // From a start (the given model, perhaps with a formula), the best explanation. `given`: effects of the
  // model.
  absl::StatusOr<Explanation> Run(FreeModel start, int given) const;

  // Every candidate as the only addition to `fit`, with the evidence that a linear fit foretells.
  absl::StatusOr<std::vector<Move>> Score(const Fit& fit, int given) const;

  // The fits in which other effects take the place of effect `index`, best first; the linear forecast chooses
  // which are fitted. The first is the fit itself.
  absl::StatusOr<std::vector<Alternative>> Alternatives(const Explanation& explanation, int index) const;

  // The fit with the effect taken out (a given effect: held at the given values).
  absl::StatusOr<Fit> WithoutEffect(const Explanation& explanation, int index) const;

  // A move fitted in full, from several starts where the response is not linear.
  absl::StatusOr<Fit> FitMove(const Move& move) const;

  double HeldoutRmse(const Fit& fit) const;

  const SearchRules& rules() const { return rules_; }
  const std::vector<Candidate>& candidates() const { return candidates_; }

 private:
  absl::StatusOr<bool> Grow(Explanation* explanation) const;
  absl::StatusOr<bool> Shrink(Explanation* explanation) const;
  absl::StatusOr<bool> Exchange(Explanation* explanation) const;
  bool Accepts(const Fit& before, const Fit& after, size_t moves) const;

  const Experiment& experiment_;
  std::vector<Candidate> candidates_;
  SearchRules rules_;
  std::function<void(const std::string&)> progress_;
};

}  // namespace touchstone
