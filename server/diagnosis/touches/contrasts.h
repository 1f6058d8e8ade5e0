// What can be seen of a touch: the differences between its fingers. The n - 1 orthonormal contrasts of the n fingers
// that report carry all of it, and noise that is independent from finger to finger stays white in them. Treating
// t - min t as independent numbers instead raised false alarms to 6.5 to 28.5 % at a nominal 5 %.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::touches {

class Contrasts {
 public:
  // The touches that are used, fingers that report and that `expected_s` (times, [k * fingers + finger]) has
  // a number for. Rows are sorted by object, then by touch.
  Contrasts(const Observations& observations, const std::vector<double>& expected_s);

  int rows() const { return rows_; }
  const std::vector<int>& touches() const { return touches_; }  // in the order of the rows
  int FirstRow(int t) const { return first_row_[t]; }           // of touches()[t]; t = count: rows()
  int FirstRowOfObject(int object) const { return object_row_[object]; }  // object = count: rows()
  const std::vector<int>& object_of_row() const { return object_of_row_; }
  const std::vector<int>& touch_of_row() const { return touch_of_row_; }  // index into touches()

  // H, (n - 1) x fingers: zero for fingers that take no part.
  const Eigen::MatrixXd& MatrixOf(int t) const { return matrices_[mask_[t]]; }
  bool TakesPart(int t, int finger) const { return (mask_[t] >> finger) & 1; }

  // A factor on each touch's rows, the square root of its weight; 1 at first. [t]
  void SetWeights(const std::vector<double>& weights);
  const std::vector<double>& root_weights() const { return root_weight_; }

  // Contrasts of one value per finger. Entries of fingers that take no part are not read.
  Eigen::VectorXd Apply(const std::vector<double>& per_finger) const;
  // The other way: values of mean 0 over each touch's fingers, [k * fingers + i] of `size` entries; NaN elsewhere.
  std::vector<double> PerFinger(const Eigen::VectorXd& rows, size_t size) const;

 private:
  int fingers_;
  int rows_ = 0;
  std::vector<int> touches_;
  std::vector<uint32_t> mask_;  // of fingers, per touch
  std::vector<int> first_row_, object_row_, object_of_row_, touch_of_row_;
  std::vector<double> root_weight_;
  std::vector<Eigen::MatrixXd> matrices_;  // by mask
};

}  // namespace touchstone::diagnosis::touches
