// A session cut into slots, each a column per finger: every course in time is a sum of slots, so that thousands of courses
// are scored from one matrix of inner products.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "server/diagnosis/selection/curves/nameless_curve.h"

namespace touchstone::diagnosis::selection {

class SessionSlots {
 public:
  // Of the columns of one course, under one hypothesis of the surface and beside the fit's own columns.
  struct Products {
    Eigen::MatrixXd a;  // with each other
    Eigen::VectorXd b;  // with the residual
    double plain = 0;   // the sum of their squares alone
  };

  // Everything must outlive it.
  SessionSlots(const engine::Experiment& experiment, const touches::TouchObservationModel& touches,
               const engine::Fit& fit, const touches::Prediction& details, const CurveCovariate& covariate);

  int touches() const { return static_cast<int>(order_.size()); }
  int columns() const { return o_.fingers - 1; }  // of a slot: fingers 1, 2, ... against the first
  double At(int place) const {
    return covariate_.value(order_[place], 0);
  }  // places: touches by the covariate
  double first() const { return At(0); }
  double last() const { return At(touches() - 1); }
  bool InSessionOrder() const;
  uint64_t TouchNumber(int place) const { return o_.set->touch[o_.row[order_[place]]]; }

  // Slots begin at these places; the first is 0.
  void Divide(std::vector<int> begins);
  int slots() const { return static_cast<int>(begins_.size()) - 1; }
  int Begin(int slot) const { return begins_[slot]; }  // slots(): touches()

  int hypotheses() const { return static_cast<int>(forms_.size()); }
  Products OfSlots(int hypothesis, int begin, int end) const;
  Products OfWeights(int hypothesis, const Eigen::VectorXd& weights) const;  // of the slots
  // What the log likelihood becomes if `drop` leaves the sum of squares; of all hypotheses together without any drop.
  double LogLikelihood(int hypothesis, double drop) const;
  double base_log() const { return base_log_; }

  Eigen::MatrixXd Columns(const Eigen::VectorXd& weights) const;  // rows x columns()

 private:
  // Under one hypothesis, with the fit's own columns projected out.
  struct Form {
    int s = 0;
    double q = 0;
    Eigen::VectorXd b, plain;
    Eigen::MatrixXd a;
    // Sums over the slots before i (and before j), so that those of any stretch are differences.
    Eigen::MatrixXd b_before, a_before;
    Eigen::VectorXd plain_before;
  };
  Form MakeForm(const Eigen::MatrixXd& gram, int s) const;
  void AddSums(Form* form) const;

  const engine::Likelihood& likelihood_;
  const touches::TouchObservationModel& touches_;
  const touches::Observations& o_;
  const engine::Fit& fit_;
  const touches::Prediction& details_;
  const CurveCovariate& covariate_;
  std::vector<int> order_;  // touches by the covariate
  std::vector<int> hypotheses_;
  std::vector<int> begins_;  // of slots, and the end
  Eigen::MatrixXd basis_;    // mm: [slot * columns() + column]
  std::vector<Form> forms_;
  double base_log_ = 0;
};

}  // namespace touchstone::diagnosis::selection
