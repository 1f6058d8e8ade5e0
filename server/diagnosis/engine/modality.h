// One kind of measurement in a diagnosis of several: touches, photographs, what else is measured, or a second session of
// the same kind. It brings rows with a noise and a smooth error of their own, what it alone finds, and how good a model is on
// all of its data.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/competition/competition.h"
#include "server/diagnosis/engine/competition/result.h"
#include "server/diagnosis/engine/nothing_missing.h"
#include "server/diagnosis/engine/search/stepwise_search.h"

namespace touchstone::diagnosis::engine {

// What final values are fitted to. The parts point to one another.
struct FinalRows {
  Experiment experiment;
  std::shared_ptr<const void> owner;  // of what `experiment` points to; null: the modality itself
};

// By how much more a fit errs on data that it did not see: sqrt((ratio rmse)^2 + excess_squares).
struct HeldOutError {
  double ratio = 1;
  double excess_squares = 0;

  double Of(double rmse) const;
};

// What it is asked for must not change once it is made, and it must outlive whatever it is given to.
class Modality {
 public:
  virtual ~Modality() = default;

  // For people, in the plural: "touches".
  virtual std::string name() const = 0;
  // The given model as far as it concerns this kind, and the names of the objects that were measured.
  virtual const model::Model& given() const = 0;
  virtual const std::vector<std::string>& objects() const = 0;
  // Whether the effect changes what is expected of these measurements. Effects that several kinds see have one value for
  // all of them.
  virtual bool Sees(const model::Effect& effect) const = 0;

  // What the search works on, and every effect that may be missing.
  virtual const Experiment& experiment() const = 0;
  virtual const std::vector<Candidate>& candidates() const = 0;
  // What this kind alone is explained by: the given model's effects first, in their order.
  virtual const Fit& alone() const = 0;

  // What that search says of an effect that it added; null: it added no such effect, or says nothing of single ones.
  virtual const SelectedStep* FoundAlone(const std::string& /*effect*/) const { return nullptr; }

  // Of the given model, over every effect, curve and kind of noise that was tried on these measurements.
  virtual const TriedPValues& tried() const = 0;

  // The rows that values are taken from, near a fit. Default: those of the search.
  virtual absl::StatusOr<FinalRows> RowsNear(const Fit& /*fit*/) const {
    return FinalRows{experiment(), nullptr};
  }
  // The covariance of a fit's values. Default: the fit's. Kinds whose rows share errors that their noise does not know of
  // give what the scatter between blocks shows.
  virtual Eigen::MatrixXd CovarianceOf(const Experiment& /*experiment*/, const Fit& fit) const {
    return fit.covariance;
  }

  // The error of a model on all data, as a comparison with it finds it. `model` has the effects of every kind.
  virtual absl::StatusOr<Quality> Compare(const model::Model& model) const = 0;
  // Of a fit to the search's rows, and the same effects fitted to RowsNear it.
  virtual absl::StatusOr<HeldOutError> HeldOut(const Fit& searched, const Fit& final) const;
};

// Over all that was tried on any of them; none: one of them cannot say.
std::optional<NothingMissing> NothingMissingOf(const std::vector<const Modality*>& modalities);

}  // namespace touchstone::diagnosis::engine
