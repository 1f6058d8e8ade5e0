// The search for what is missing: effects are added, values set free, removed and swapped, as long as the evidence
// grows by enough that chance would not do it in one set of a hundred.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/fit/fit.h"
#include "server/diagnosis/engine/search/candidates.h"

namespace touchstone::diagnosis::engine {

// Thresholds, chosen on the tuning seeds of tests/hidden_effects.
struct SearchRules {
  double enter_nats = 4.5;              // gain in log evidence that a step needs
  double family_wise_p = 2e-3;          // of the likelihood ratio, over all extensions of the rig
  double enter_rare_nats = 9;           // ... that an effect needs which does not act on all objects alike
  double swap_nats = 4;                 // that a swap to an effect of more values needs
  double min_relative_cv_gain = 0.003;  // share by which the held-out error must fall
  // ... its square by that share of the noise's square, not of its own: where a smooth error of the surface may hold
  // most of the error that a later step explains, and the first step's share of that is nothing.
  bool cv_gain_over_noise = false;
  // ... and where a fit leaves more than rest_sigma times the noise, by this share: what nothing explains gives way a little to
  // every effect, and each of them would be fitted beside all others.
  double rest_cv_gain = 0, rest_sigma = 0;
  // ... and the logarithm of a part's held-out error, of its mean over parts; 0: parts are not compared one by one.
  double min_cv_gain_std_errors = 0;
  double equivalent_nats = 3;           // explanations as near as this are named together
  double complexity_penalty_nats = 11;  // of a formula term that was picked from a dictionary
  int min_rows_per_parameter = 8;       // that each fitted value needs
  int max_steps = 12;  // additions: a set of six causes may let in others on the way, which leave again
  // Steps that are taken on trial beyond one with which the held-out error does not fall, where what else is missing hides
  // its gain: all of them are steps if its square falls by such a share with the last.
  int max_trial_steps = 3;
  double min_trial_cv_gain = 0.5;
  // Share of what a step gains that the linearised prediction must give to another effect, declared to resemble it, for it
  // to be fitted in the step's place.
  double min_declared_share = 0;
  int max_refits = 6;       // candidates that are fitted in full per step
  int max_rare_refits = 4;  // ... of those that do not act on all objects alike
};

// One way to extend a fit.
struct Extension {
  int candidate = -1;       // index into the candidates; -1: sets an effect of the model free
  int given = -1;           // ... its index in the model
  std::string name;         // of the effect
  std::string object;       // the only one on which it acts; empty: on all
  bool rare = false;        // Candidate::rare
  bool nameless = false;    // Candidate::nameless
  bool visible = false;     // false: nothing changes near the start
  double log_evidence = 0;  // linearised prediction, nats
  Parameterization start;
  // Where it fits best on a grid of sizes, of those at which the rows move: of an effect whose response is no line, which may
  // show nothing near the start. None: it is not asked, or no row moves at any size.
  std::optional<Parameterization> acts_at = {};

  bool Acts() const { return visible || acts_at.has_value(); }  // false: this experiment cannot see it
};

// What an extension changes of the rows of `fit`: its derivatives at the start; of one that shows nothing there, the whole change
// where it acts, as one column. Errors as Derivatives.
absl::StatusOr<Eigen::MatrixXd> ResponseColumns(const Experiment& experiment, const Extension& extension,
                                                const Fit& fit);

// Two extensions at once, of those that act on all objects alike and are visible.
struct PairOfExtensions {
  int first = 0, second = 0;  // indices into the extensions; first < second
  double log_evidence = 0;    // linearised prediction, nats
};

// One effect in the place of another, fitted.
struct CompetingFit {
  std::string name;  // "given:finger_length": another value of an effect that the model has
  bool per_object = false;
  std::string object;     // the only one on which it acts; empty: on all
  bool nameless = false;  // Candidate::nameless
  Fit fit;
};

struct Explanation {
  Fit fit;
  int initial_effects = 0;  // effects below this index are the initial model's
};

class StepwiseSearch {
 public:
  // `experiment` must outlive it. `progress` is told what is fitted.
  StepwiseSearch(const Experiment& experiment, std::vector<Candidate> candidates, SearchRules rules,
                 std::function<void(const std::string&)> progress)
      : experiment_(experiment),
        candidates_(std::move(candidates)),
        rules_(rules),
        progress_(std::move(progress)) {}

  // From a start (the initial model, perhaps with a formula), the best explanation.
  absl::StatusOr<Explanation> Run(Parameterization start, int initial_effects) const;

  // The same from an explanation that was found elsewhere: what it has beyond the initial model is tried against others
  // first, and goes where it is not worth its values.
  absl::StatusOr<Explanation> Continue(Explanation explanation) const;

  // Every way to extend `fit` that is tried: candidates, values of the initial model's effects set free. Not scored yet.
  std::vector<Extension> ListExtensions(const Fit& fit, int initial_effects) const;

  // Every candidate as the only addition to `fit`, with the evidence that a linear fit predicts; where the rows do not depend on
  // it near the start, what it predicts from the best size on a grid. Of effects on one object that are far behind, only an
  // estimate (candidate_scores.cpp).
  // `pairs`, if given: two of them at once, best first.
  absl::StatusOr<std::vector<Extension>> Score(const Fit& fit, int initial_effects,
                                               std::vector<PairOfExtensions>* pairs = nullptr) const;

  // The fits in which other effects, or other values of the model's own, take the place of effect `index`, best first;
  // the linearised prediction, and what effects declare of one another, choose which are fitted. The first is the fit
  // itself.
  absl::StatusOr<std::vector<CompetingFit>> CompetingFits(const Explanation& explanation, int index) const;

  // The fit with the effect taken out (one of the initial model: held at its values there).
  absl::StatusOr<Fit> WithoutEffect(const Explanation& explanation, int index) const;

  // An extension fitted in full, from several starts where the response is not linear. `from`: the fit that it extends, if
  // that is at hand (FitModel's `part`).
  absl::StatusOr<Fit> FitExtension(const Extension& extension, const Fit* from = nullptr) const;

  const Experiment& experiment() const { return experiment_; }
  const SearchRules& rules() const { return rules_; }
  const ObservationModel& observations() const { return *experiment_.observations; }
  const std::vector<Candidate>& candidates() const { return candidates_; }

 private:
  absl::StatusOr<bool> AddStep(Explanation* explanation) const;
  absl::StatusOr<bool> RemoveStep(Explanation* explanation) const;
  absl::StatusOr<bool> SwapStep(Explanation* explanation) const;
  absl::Status Improve(Explanation* explanation) const;  // swaps and removals, as long as there are any
  // An extension that was fitted; `tried`: how many it was chosen from.
  struct Tried {
    Fit fit;
    size_t tried = 0;
    bool rare = false;
  };
  // Those that gain enough by the likelihood, best first. `extensions`: of Score.
  absl::StatusOr<std::vector<Tried>> LikelyExtensions(const Fit& from,
                                                      std::vector<Extension> extensions) const;
  // One that lets the error on rows fall that it did not see, of `likely`, or else of what may follow the best of them.
  absl::StatusOr<bool> AddOne(std::vector<Tried> likely, Explanation* explanation) const;
  // Two of which neither explains enough by itself.
  absl::StatusOr<bool> AddTwo(const std::vector<Extension>& extensions,
                              const std::vector<PairOfExtensions>& pairs, Explanation* explanation) const;
  // `model` with what the extension frees or adds, where it changes nothing.
  void Extend(const Extension& extension, Parameterization* model) const;
  // Whether it gains enough by the likelihood.
  bool IsLikely(const Fit& before, const Tried& after) const;
  // Whether rows that it did not see agree.
  absl::StatusOr<bool> FallsHeldOut(const Fit& before, const Fit& after, bool rare) const;
  double EnterNats(bool rare) const { return rare ? rules_.enter_rare_nats : rules_.enter_nats; }

  const Experiment& experiment_;
  std::vector<Candidate> candidates_;
  SearchRules rules_;
  std::function<void(const std::string&)> progress_;
};

}  // namespace touchstone::diagnosis::engine
