// What could take the place of each effect that a search has found: other effects, other values of the model's own, what
// has no name.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/competition/result.h"
#include "server/diagnosis/engine/search/stepwise_search.h"

namespace touchstone::diagnosis::engine {

// Another way to explain what one step explains.
struct CompetingEffect {
  std::string name;
  bool per_object = false;
  std::string object;                // the only one on which it acts; empty: on all
  double relative_log_evidence = 0;  // nats, over the step's own
  bool equivalent = false;           // these data cannot tell it from the step
  bool stopped = false;              // ... if its value could go beyond its bound
  model::Model model;                // the whole model with it
};

// Something without a name in the place of a named effect: a curve of time, a drift of the fingers.
struct NamelessRival {
  double ahead_nats = 0;  // log evidence over the effect's own
  std::string words;      // a sentence that says what it is
};

struct SelectedStep {
  int effect = 0;          // index in the fit's model
  double gain_nats = 0;    // over the fit without it
  double probability = 1;  // with its equivalents, among all that could take its place; 1: not assessed
  std::vector<CompetingEffect> competing;  // best first
  std::string words;                       // what has no name and says nearly the same; empty: nothing does
};

// Every effect beyond the initial model's but the one at index `nameless` (-1: none). `rivals`: by the effect whose place
// they would take. Errors as FitModel.
absl::StatusOr<std::vector<SelectedStep>> FindCompetitors(const StepwiseSearch& search,
                                                          const Explanation& whole, int nameless,
                                                          const std::map<std::string, NamelessRival>& rivals);

// Fitted models between which the data leave open, the best first; one: nothing competes with it.
struct ExplanationsLeft {
  struct NamedModel {
    std::string name;  // of the step or of what takes its place; "the model as it is" where there is no step
    std::shared_ptr<const model::Model> model;
  };
  std::vector<NamedModel> models;
  bool confounded = false;  // whether an effect is equivalent to the step
};
// Of the step that is hardest to tell from what competes with it. `best`: the model with every step.
ExplanationsLeft FindExplanationsLeft(const Fit& fit, const std::vector<SelectedStep>& steps,
                                      const model::Model& best);

// Whether a value of effect `index` ended at a bound that is not the value that changes nothing.
bool IsAtBound(const Fit& fit, int index);
// Whether every free value of effect `index` ended at its neutral, usually a bound.
bool ChangesNothing(const Fit& fit, int index);

// Of an explanation whose evidence has this share, as a logarithm, of the evidence of all: the one place that keeps
// probabilities at or below CompetitionRules::max_probability.
double ProbabilityOfShare(double log_share);
// The same from a log of odds, nats.
double ProbabilityOf(double log_odds);

// Of the explanation in question and what the data cannot tell from it, by their log evidence among all that could explain
// the same.
double ProbabilityAmong(const std::vector<double>& same, const std::vector<double>& all);

// P of the values of an effect if it changed nothing, by WaldP.
double NeutralP(const Parameterization& model, int effect, const Eigen::VectorXd& point,
                const Eigen::MatrixXd& covariance);

// P of values at least as far from zero as `difference` by chance, by Wald's test; values without a variance take no part.
// 1 where nothing is known.
double WaldP(const Eigen::VectorXd& difference, const Eigen::MatrixXd& covariance);

}  // namespace touchstone::diagnosis::engine
