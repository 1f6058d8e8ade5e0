// The one likelihood that every explanation is judged by: residuals are what the effects leave, plus a smooth
// error of each group's surface, plus noise.
//
//   r = J theta + B h + e,   e ~ N(0, sigma^2 I),   h ~ GP(0, a^2 Matern-5/2(distance / length)) per group
//
// B turns a bump h along the normal into rows (SmoothErrorGeometry). The field always takes part, so that the
// bumps of a bad print are not sold as physics: without it, BIC claimed an effect in up to 80 % of sets that had
// bumps and nothing else. Its amplitude and length are not estimated but averaged over a grid of hypotheses;
// sigma is profiled. With the field integrated out, everything is a function of inner products, so a candidate
// costs no pass over the data.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "server/base/threads/thread_pool.h"
#include "server/diagnosis/engine/fit/smooth_error.h"

namespace touchstone::diagnosis::engine {

// One hypothesis about the smooth error.
struct SurfaceErrorHypothesis {
  double length_m = 0;              // correlation length
  double amplitude_over_sigma = 0;  // bumps in m over noise in the unit of the rows
  double log_determinant = 0;       // of the rows' covariance over sigma^2
  double effective_dof = 0;         // degrees of freedom that the field takes up
  int length_index = -1;            // -1: no smooth error
};

class Likelihood {
 public:
  // `group_rows`: first row of each group, then the number of rows. `geometry` null: no smooth error (large
  // sets). `floor`: what the simulation itself may be wrong by, in the unit of the rows; keeps data without
  // noise from proving anything.
  Likelihood(std::vector<int> group_rows, const SmoothErrorGeometry* geometry, double floor,
             ThreadPool* pool);

  // The noise cannot be less than this, in the unit of the rows, however small the residuals are: where something else
  // than the rows has measured it. Default 0: it is whatever they show.
  void SetLeastNoise(double sigma) { least_sigma_ = sigma; }

  // So many degrees of freedom of the rows are taken by values that every prediction fits to them (the pose of each
  // picture): the noise is judged by what is left. Default 0.
  void SetEliminated(int values) { eliminated_ = values; }

  // The first is that there is no smooth error.
  const std::vector<SurfaceErrorHypothesis>& hypotheses() const { return hypotheses_; }
  int rows() const { return group_rows_.back(); }

  // Columns of rows (the residual, derivatives), prepared for any hypothesis.
  struct Columns {
    Eigen::MatrixXd values;                  // rows x columns
    std::vector<Eigen::MatrixXd> projected;  // by length: onto the field's directions
    Eigen::MatrixXd inner;                   // values' values; empty in very wide sets of columns
  };
  Columns Prepare(const Eigen::MatrixXd& values) const;
  static Columns Join(const Columns& a, const Columns& b);
  static Columns Pick(const Columns& all, const std::vector<int>& columns);

  // X' V^-1 X under hypothesis s, sigma = 1.
  Eigen::MatrixXd Gram(const Columns& columns, int s) const;
  // The part of each group in Gram: groups share no error, so the parts sum to it. `inner`: of InnerByGroup.
  std::vector<Eigen::MatrixXd> GramByGroup(const Columns& columns, const std::vector<Eigen::MatrixXd>& inner,
                                           int s) const;
  // X' X of each group's rows.
  std::vector<Eigen::MatrixXd> InnerByGroup(const Columns& columns) const;
  // a' V^-1 B, every column of b, and diag(B' V^-1 B).
  Eigen::MatrixXd Cross(const Columns& a, const Columns& b, int s) const;
  Eigen::VectorXd Norms(const Columns& columns, int s) const;

  // -(N/2) log(Q/N + floor^2) - (1/2) log det, for a quadratic form Q of N rows less those eliminated; with noise of at least s, the same where Q/N is
  // larger than s^2, else the normal density of noise s.
  double LogLikelihood(double q, int s) const;
  double Sigma(double q, int parameters) const;  // in the unit of the rows
  // The prior weight of hypothesis s, in nats: half for "none", the rest even.
  double LogPrior(int s) const;

  // What the field explains of residual r under hypothesis s (posterior mean), rows.
  Eigen::VectorXd FieldMean(const Columns& r, int s) const;
  // What the field expects of each row of `columns` from the rows of its group in other folds. `fold_of_row`:
  // 0 .. folds-1. `grams`, if given: X' V^-1 X of the rows outside each fold, sigma = 1.
  Eigen::MatrixXd FieldLeftOut(const Eigen::MatrixXd& columns, int s, const std::vector<int>& fold_of_row,
                               int folds, std::vector<Eigen::MatrixXd>* grams = nullptr) const;

 private:
  struct Basis {                              // of one length
    std::vector<Eigen::MatrixXd> directions;  // per group: its rows x m, orthogonal columns
    Eigen::VectorXd energies;                 // all groups' columns, squared norms
  };
  void MakeBases(const SmoothErrorGeometry& geometry, const std::vector<double>& length_m, ThreadPool* pool);
  Eigen::VectorXd Shrinkage(int s) const;  // ratio^2 / (1 + ratio^2 energy), one per direction

  std::vector<int> group_rows_;
  double floor_;
  double least_sigma_ = 0;
  int eliminated_ = 0;
  std::vector<Basis> bases_;
  std::vector<SurfaceErrorHypothesis> hypotheses_;
};

}  // namespace touchstone::diagnosis::engine
