// The evidence of what sessions of one kind of measurement share, to second order: each session is fitted once with every
// value its own, and what any other assumption would leave follows from the inner products of its rows.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/joint/side.h"

namespace touchstone::diagnosis::joint {

// How sessions have the values of one effect.
enum class SessionValues {
  kGiven,   // where the given model has them, or where they change nothing
  kShared,  // one value for all
  kOwn,     // each session its own
};

// Values that change together: those of one effect, or, where they differ by object, those of one object.
struct ValueGroup {
  std::string effect, object;
  bool given = false;         // of the given model
  std::vector<int> sessions;  // that measure it
  std::vector<int> values;    // of SessionEvidence
  double least_nats = 0;      // of log evidence, that the values need over none
};

// What an assumption about every group leaves.
struct SharedEvidence {
  double log_evidence = 0;
  double squares = 0;  // twice the fall of the log likelihood: chi-squared of what is assumed beyond
  int free = 0;        // values
  std::vector<std::vector<int>>
      place;                   // by session and value of the session: among the free values; -1: held
  Eigen::VectorXd step;        // of the free values, from the given ones
  Eigen::MatrixXd covariance;  // of the free values
};

class SessionEvidence {
 public:
  // `sides`: one per session. `effects`: every effect that any session may have. Errors as FitModel.
  static absl::StatusOr<SessionEvidence> Create(const std::vector<Side>& sides,
                                                const std::vector<SharedEffect>& effects);

  const std::vector<ValueGroup>& groups() const { return groups_; }
  int sessions() const { return static_cast<int>(fits_.size()); }
  // Of each session with every value its own.
  const engine::Fit& fit(int session) const { return fits_[session]; }
  // By how much the variance of the session's values exceeds what independent rows give them, at least 1: where repeats of a
  // pose or stretches of the session share errors.
  double variance_factor(int session) const { return variance_factors_[session]; }

  // `states`: one per group.
  SharedEvidence Of(const std::vector<SessionValues>& states) const;
  // The session's values, and their covariance with those of another session; held values have none.
  Eigen::VectorXd PointOf(const SharedEvidence& evidence, int session) const;
  Eigen::MatrixXd CovarianceOf(const SharedEvidence& evidence, int session, int other) const;
  // By how much one unit of a session's value moves its rows: root mean square over the rows that it moves, over the noise.
  double MovesRows(int session, int value) const;
  // Degrees of freedom of the noise under an assumption: rows, fewer where they share errors, less the free values.
  double DegreesUnder(const SharedEvidence& evidence) const;

 private:
  struct Value {
    engine::FreeParameter parameter;
    int group = 0;
  };
  void ListValues();
  void PrepareForms(const std::vector<Side>& sides, const std::vector<SharedEffect>& effects);

  std::vector<engine::Fit> fits_;
  std::vector<double> variance_factors_;
  double independent_ = 0;                  // rows or blocks
  std::vector<Value> values_;               // of all sessions
  std::vector<std::vector<int>> value_of_;  // by session and its value: index into values_
  std::vector<ValueGroup> groups_;
  std::vector<Eigen::MatrixXd>
      forms_;  // by session: of [residual | derivatives] where the values are the given ones,
               // over the noise
  std::vector<Eigen::VectorXd> given_;        // by session: the given values
  std::shared_ptr<engine::Likelihood> unit_;  // noise 1
};

}  // namespace touchstone::diagnosis::joint
