// Residuals and columns of repeats, each less its mean over the touches of its pose: what is the same in every touch of a pose
// is gone.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "server/base/numbers/random.h"
#include "server/diagnosis/touches/contrasts.h"

namespace touchstone::diagnosis::selection {

class Repeats {
 public:
  // Touches of one pose in which the same fingers report. Both must outlive it.
  Repeats(const touches::Observations& observations, const touches::Contrasts& contrasts);

  double degrees() const { return degrees_; }  // of freedom, of the rows about the means of their poses

  // `rows`: contrast rows x columns. Rows without repeats are 0.
  Eigen::MatrixXd Centred(const Eigen::MatrixXd& rows) const;
  // Degrees of freedom that values with these derivatives (contrast rows x columns) take of the repeats, 0 to 1 each: the share of
  // a column's squares that differs within poses. What is the same in every touch of a pose fixes the rest of a value.
  double DegreesTaken(const Eigen::MatrixXd& columns) const;
  // The rows of touches that `has` names, by index into the contrasts' touches; 0 elsewhere.
  Eigen::MatrixXd Only(const Eigen::MatrixXd& rows, const std::vector<char>& has) const;
  // With the touches of each pose in another order.
  Eigen::VectorXd Shuffled(const Eigen::VectorXd& rows, RandomStream* random) const;

 private:
  int RowsOf(int t) const { return contrasts_.FirstRow(t + 1) - contrasts_.FirstRow(t); }

  const touches::Contrasts& contrasts_;
  std::vector<std::vector<int>> cells_;  // indices of touches
  double degrees_ = 0;
};

}  // namespace touchstone::diagnosis::selection
