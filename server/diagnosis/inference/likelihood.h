// The one likelihood that every explanation is judged by: residuals are what the effects leave, plus a smooth
// error of each object's surface, plus noise.
//
//   r = J theta + B h + e,   e ~ N(0, sigma^2 I),   h ~ GP(0, a^2 Matern-5/2(distance / length)) an object
//
// B turns a bump h along the normal into contact time: -slope / cos(incidence). The field always takes part,
// so that the bumps of a bad print are not sold as physics (DIAGNOSIS: BIC alone claims an effect in up to 80
// % of such sets). Its amplitude and length are not estimated but averaged over a grid; sigma is profiled.
// With the field integrated out, everything is a function of inner products, so a candidate costs no pass
// over the data.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "server/base/thread_pool.h"
#include "server/diagnosis/touches/contrasts.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone {

class Likelihood {
 public:
  // `details` of the nominal model: where the contacts are. `field` false: no surface error (large sets).
  // `floor_s`: what the simulation itself may be wrong by; keeps data without noise from proving anything.
  Likelihood(const Observations& observations, const Contrasts& contrasts, const Prediction& details,
             bool field, double floor_s, ThreadPool* pool);

  // One hypothesis about the surface error; the first is that there is none.
  struct Surface {
    double length_m = 0;
    double ratio_m_s = 0;  // amplitude over sigma
    double log_determinant = 0;
    double degrees = 0;  // of freedom that the field takes up
    int length_index = -1;
  };
  const std::vector<Surface>& surfaces() const { return surfaces_; }
  int rows() const { return rows_; }

  // Columns of contrasts (the residual, derivatives), prepared for any hypothesis.
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
  // a' V^-1 B, every column of b, and diag(B' V^-1 B).
  Eigen::MatrixXd Cross(const Columns& a, const Columns& b, int s) const;
  Eigen::VectorXd Norms(const Columns& columns, int s) const;

  // -(N/2) log(Q/N + floor^2) - (1/2) log det, for a quadratic form Q.
  double LogLikelihood(double q, int s) const;
  double Sigma(double q, int parameters) const;  // seconds
  // The prior weight of hypothesis s, in nats: half for "none", the rest even.
  double LogPrior(int s) const;

  // What the field explains of residual r under hypothesis s (posterior mean), rows.
  Eigen::VectorXd FieldMean(const Columns& r, int s) const;

 private:
  struct Basis {                              // of one length
    std::vector<Eigen::MatrixXd> directions;  // an object: its rows x m, orthogonal columns
    Eigen::VectorXd energies;                 // all objects' columns, squared norms
  };
  Eigen::VectorXd Shrinkage(int s) const;  // ratio^2 / (1 + ratio^2 energy), one a direction

  int rows_;
  double floor_s_;
  std::vector<int> object_row_;
  std::vector<Basis> bases_;
  std::vector<Surface> surfaces_;
};

}  // namespace touchstone
