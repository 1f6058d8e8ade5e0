// The evidence that rows would give which were not measured: of an effect of some size, and of what would be fitted in its
// place. Inner products stand for the rows: those of the effect's response, plus what noise adds to them.
#pragma once

#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "server/diagnosis/engine/search/stepwise_search.h"

namespace touchstone::diagnosis::engine {

// What an effect of one size leads to.
struct ExpectedStep {
  Eigen::VectorXd point;       // of the extension's parameters
  Eigen::VectorXd response;    // what the effect adds to the rows
  Likelihood::Columns column;  // the same, prepared
  double ratio = 0;            // twice the gain in log likelihood, without noise
  double gain_nats = 0;        // in log evidence, likewise
  double log_evidence = 0, log_likelihood = 0;
  Eigen::MatrixXd covariance;  // of the parameters
};

// An extension fitted to the response of another.
struct ExpectedRival {
  Eigen::VectorXd point;
  LaplaceEvidence evidence;
};

// Of the extensions of a fit that act on all objects alike. Everything that it is given must outlive it.
class ExpectedEvidence {
 public:
  // `sigma`: noise of one row (> 0). Errors as Derivatives.
  static absl::StatusOr<ExpectedEvidence> Create(const StepwiseSearch& search, const Fit& given,
                                                 int initial_effects, double sigma);

  const std::vector<Extension>& extensions() const { return extensions_; }
  int own() const { return own_; }  // parameters of the given fit, which come first in every extension
  double sigma() const { return sigma_; }
  int rows() const { return likelihood().rows(); }

  // Extension m with parameter i at a size, the others where they change nothing or (`together`) at what rigs show.
  absl::StatusOr<ExpectedStep> At(int m, int i, double size, bool together) const;
  // What a search needs of that in twice the log likelihood.
  double RatioNeeded(int m, const ExpectedStep& step) const;
  // The chance that a search of such rows takes the step, 0 to 1.
  double Power(int m, const ExpectedStep& step) const;

  // The given model alone, and extension m from where it starts, to first order, on rows with that response.
  LaplaceEvidence Without(const ExpectedStep& step) const;
  LaplaceEvidence Linear(const ExpectedStep& step, int m) const;
  // The same by the simulator, where the extension's values are best.
  absl::StatusOr<ExpectedRival> Fitted(const ExpectedStep& step, int m) const;
  // Share of the response's squares that the columns of extension m, with the model's own, explain.
  double ShareExplainedBy(int m, const ExpectedStep& step) const;

 private:
  // Columns of one extension among all, after the model's own.
  struct Span {
    int first = 0, count = 0;
  };

  ExpectedEvidence(const StepwiseSearch& search, const Fit& given, double sigma);
  const Likelihood& likelihood() const { return *experiment_.likelihood; }
  double NoiseSquares(int s) const;
  Eigen::VectorXd PointAt(const Extension& extension, int i, double size, bool together) const;
  std::vector<Eigen::MatrixXd> GramsOf(const Likelihood::Columns& truth, int m) const;
  std::vector<Eigen::MatrixXd> GramsWith(const Extension& extension, const Eigen::MatrixXd& columns) const;

  const StepwiseSearch* search_;
  Experiment experiment_;  // without a pool: several sizes are asked for side by side
  const Fit* given_;
  int own_;
  double sigma_;
  std::vector<Extension> extensions_;
  std::vector<Span> spans_;             // [extension]
  Likelihood::Columns all_;             // the model's own, then every extension's
  std::vector<Eigen::MatrixXd> grams_;  // of all_, by hypothesis
};

}  // namespace touchstone::diagnosis::engine
