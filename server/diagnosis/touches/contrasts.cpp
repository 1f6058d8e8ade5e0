#include "server/diagnosis/touches/contrasts.h"

#include <algorithm>
#include <cmath>

namespace touchstone::diagnosis::touches {
namespace {

// Orthonormal rows that sum to zero over the fingers of the mask (Helmert's).
Eigen::MatrixXd Helmert(uint32_t mask, int fingers) {
  std::vector<int> members;
  for (int i = 0; i < fingers; ++i)
    if ((mask >> i) & 1) members.push_back(i);
  const int n = static_cast<int>(members.size());
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(std::max(n - 1, 0), fingers);
  for (int row = 1; row < n; ++row) {
    const double norm = std::sqrt(static_cast<double>(row) * (row + 1));
    for (int j = 0; j < row; ++j) matrix(row - 1, members[j]) = -1 / norm;
    matrix(row - 1, members[row]) = row / norm;
  }
  return matrix;
}

}  // namespace

Contrasts::Contrasts(const Observations& observations, const std::vector<double>& expected_s)
    : fingers_(observations.fingers), matrices_(size_t{1} << observations.fingers) {
  std::vector<std::vector<int>> of_object(observations.objects.size());
  for (int k = 0; k < observations.size(); ++k)
    if (observations.used[k]) of_object[observations.object[k]].push_back(k);
  for (size_t object = 0; object < of_object.size(); ++object) {
    object_row_.push_back(rows_);
    for (const int k : of_object[object]) {
      uint32_t mask = 0;
      int members = 0;
      for (int i = 0; i < fingers_; ++i) {
        const size_t entry = static_cast<size_t>(k) * fingers_ + i;
        if (std::isnan(observations.time_s[entry]) || std::isnan(expected_s[entry])) continue;
        mask |= 1u << i;
        ++members;
      }
      if (members < 2) continue;
      if (matrices_[mask].size() == 0) matrices_[mask] = Helmert(mask, fingers_);
      first_row_.push_back(rows_);
      object_of_row_.insert(object_of_row_.end(), members - 1, static_cast<int>(object));
      touch_of_row_.insert(touch_of_row_.end(), members - 1, static_cast<int>(touches_.size()));
      touches_.push_back(k);
      mask_.push_back(mask);
      rows_ += members - 1;
    }
  }
  first_row_.push_back(rows_);
  object_row_.push_back(rows_);
  root_weight_.assign(touches_.size(), 1.0);
}

void Contrasts::SetWeights(const std::vector<double>& weights) {
  for (size_t t = 0; t < touches_.size(); ++t) root_weight_[t] = std::sqrt(weights[t]);
}

Eigen::VectorXd Contrasts::Apply(const std::vector<double>& per_finger) const {
  Eigen::VectorXd result(rows_);
  for (size_t t = 0; t < touches_.size(); ++t) {
    const Eigen::MatrixXd& matrix = matrices_[mask_[t]];
    const double* values = &per_finger[static_cast<size_t>(touches_[t]) * fingers_];
    for (int row = 0; row < matrix.rows(); ++row) {
      double sum = 0;
      for (int i = 0; i < fingers_; ++i)
        if ((mask_[t] >> i) & 1) sum += matrix(row, i) * values[i];
      result[first_row_[t] + row] = root_weight_[t] * sum;
    }
  }
  return result;
}

std::vector<double> Contrasts::PerFinger(const Eigen::VectorXd& rows, size_t size) const {
  std::vector<double> values(size, NAN);
  for (size_t t = 0; t < touches_.size(); ++t) {
    const Eigen::MatrixXd& h = matrices_[mask_[t]];
    for (int i = 0; i < fingers_; ++i) {
      if (!TakesPart(static_cast<int>(t), i)) continue;
      double sum = 0;
      for (int row = 0; row < h.rows(); ++row) sum += h(row, i) * rows[first_row_[t] + row];
      values[static_cast<size_t>(touches_[t]) * fingers_ + i] = sum / root_weight_[t];
    }
  }
  return values;
}

}  // namespace touchstone::diagnosis::touches
