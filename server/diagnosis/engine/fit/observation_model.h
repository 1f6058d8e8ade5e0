// What the engine is given: rows of numbers that were measured, and a simulator that predicts them. A room of
// observations (touches/, later images/) implements this; see server/README.md.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "server/diagnosis/engine/fit/rules.h"
#include "server/model/model.h"

namespace touchstone::diagnosis::engine {

// Rows are differences that noise leaves independent, of equal variance. Rows of one group (an object) follow
// each other; a group's smooth error and its own values concern its rows only. Methods are const and may be
// called from several threads at once.
class ObservationModel {
 public:
  virtual ~ObservationModel() = default;

  virtual int rows() const = 0;
  virtual const std::vector<std::string>& groups() const = 0;  // names, as in the model's per-object values
  virtual int FirstRowOfGroup(int group) const = 0;            // group = count: rows()
  virtual int GroupOfRow(int row) const = 0;
  // First row of each group, then the number of rows.
  std::vector<int> GroupRows() const {
    std::vector<int> first;
    for (int group = 0; group <= static_cast<int>(groups().size()); ++group)
      first.push_back(FirstRowOfGroup(group));
    return first;
  }
  // Rows of one block share their errors (repeats of one pose): they are left out of a fit together.
  virtual int BlockOfRow(int row) const = 0;
  // When the row was measured, in any unit that grows with time: what a stretch of time is, that is left out together.
  virtual double TimeOfRow(int row) const = 0;

  // What the deterministic part of a model expects, one number per reading; NaN where it expects none. Only the
  // methods below read it.
  virtual absl::StatusOr<std::vector<double>> Predict(const model::Model& model) const = 0;
  // Measured minus predicted, as rows.
  virtual Eigen::VectorXd Residual(const std::vector<double>& predicted) const = 0;
  // `moved` minus `predicted`, as rows, for a derivative: readings that jump between the two (another face is
  // met) count as unchanged.
  virtual Eigen::VectorXd Change(const std::vector<double>& predicted,
                                 const std::vector<double>& moved) const = 0;

  // For derivatives: what `moved` expects, near `at`, of which `predicted` is known. Simulations that are dear answer
  // by what they have seen nearby. Called from tasks of a thread pool.
  virtual absl::StatusOr<std::vector<double>> PredictNear(const model::Model& moved, const model::Model&,
                                                          const std::vector<double>&) const {
    return Predict(moved);
  }
  // The same for fits that read all rows but these, whose predictions may be anything finite: what is expensive to simulate
  // leaves them out.
  virtual absl::StatusOr<std::vector<double>> PredictOthers(const model::Model& model,
                                                            const std::vector<int>& /*unread*/) const {
    return Predict(model);
  }
  virtual absl::StatusOr<std::vector<double>> PredictOthersNear(const model::Model& moved,
                                                                const model::Model& at,
                                                                const std::vector<double>& predicted,
                                                                const std::vector<int>& /*unread*/) const {
    return PredictNear(moved, at, predicted);
  }
  // That prediction with the rows that it left out; `predicted` itself where it leaves none out.
  virtual absl::StatusOr<std::vector<double>> CompletePrediction(const model::Model& /*model*/,
                                                                 const std::vector<double>& predicted) const {
    return predicted;
  }
  // The sum of squares of rows under values that were found without them, where it is not that of these rows' residuals:
  // a block with values of its own that every prediction fits to it (the pose of a picture) is no judge of the shared
  // ones unless those are fitted to another part of it. Rows of whole blocks.
  virtual std::optional<double> SquaresOfUnseen(const model::Model&, const std::vector<int>&) const {
    return std::nullopt;
  }
  // Degrees of freedom that values of their own take from the rows: every prediction fits them (the pose of each picture).
  virtual int EliminatedValues() const { return 0; }
  // Columns of noise as such fits leave it.
  virtual Eigen::MatrixXd WithoutEliminated(Eigen::MatrixXd noise) const { return noise; }
  // How far a value moves for a derivative, over its parameter's scale.
  virtual double DerivativeStep() const { return kFitRules.derivative_step; }
  // Whether derivatives by this effect hold only near where the rows were made, and are known roughly even there: what is
  // known to act nearly alike is then told from it by a clear share of what it explains only.
  virtual bool HasRoughDerivatives(const model::Effect&) const { return false; }
};

}  // namespace touchstone::diagnosis::engine
