// What columns over the pixels explain of residuals, from sums per pose: how sure that is by the scatter between poses, not
// between pixels, and what they take from poses and objects that they were not fitted to.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace touchstone::diagnosis::images {

// Weighted sums of one pose: `squares` X'WX, `cross` X'Wr, W one over the noise's variance of each pixel.
struct PoseSums {
  Eigen::MatrixXd squares;
  Eigen::VectorXd cross;
};

struct TermScore {
  bool determined = false;
  Eigen::VectorXd values;  // of the columns
  double gain_nats = 0;    // log evidence over none
  double p = 1;            // of the likelihood ratio, were nothing there
  // Weighted squares, in the noise's variance: that the fit takes from what it saw, and from a fifth of the poses that it
  // did not see (five times).
  double taken = 0, taken_unseen = 0;
  bool every_object =
      false;  // fitted to all others, it takes some from each object too; of one object alone: true
};

// `precision` of the values' prior. `objects`: of each pose.
TermScore ScoreSums(const std::vector<PoseSums>& poses, const std::vector<int>& objects,
                    const Eigen::MatrixXd& precision);

// What the means of cells, each with a prior of width `size`, take from poses that they were not fitted to: the nameless
// competitor of all terms. `squares`, `cross`: [pose](cell).
double UnseenOfMeans(const std::vector<Eigen::VectorXd>& squares, const std::vector<Eigen::VectorXd>& cross,
                     double size);

}  // namespace touchstone::diagnosis::images
