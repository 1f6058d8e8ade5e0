// Finds the slice (one or two conditions on binned covariates) with the highest score, by histograms of one
// and of two covariates: the cost is the number of cells times the pairs of covariates, whatever the number
// of thresholds. After SliceLine (Sagadeeva, Boehm, SIGMOD 2021), with signed residuals.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/diagnosis/residuals/slices/covariates.h"

namespace touchstone::diagnosis::residuals {

// Cuts of one covariate at numbers that are easy to read.
class SliceBins {
 public:
  static constexpr int kMax = 64;
  static constexpr uint8_t kUnknown = 255;

  // `values` are the cells' values, NaN where unknown.
  SliceBins(const ResidualCovariate* covariate, std::vector<double> values);

  const ResidualCovariate& covariate() const { return *covariate_; }
  int count() const { return count_; }         // 1: cannot be cut
  bool category() const { return category_; }  // bins are labels or few distinct levels
  uint8_t Bin(double value) const;
  // The condition that a bin from `low` to `high` (inclusive) stands for; empty if that is all of them.
  std::string Words(int low, int high) const;

 private:
  std::string Number(double value) const;

  const ResidualCovariate* covariate_;
  bool category_ = false;
  int count_ = 1;
  std::vector<double> thresholds_;  // numbers: bin b lies between thresholds b - 1 and b
  std::vector<double> levels_;      // few distinct numbers: bin b is level b
};

// Bins low .. high of one covariate.
struct SliceCondition {
  int covariate = -1;
  uint8_t low = 0, high = 0;
  bool Holds(uint8_t bin) const { return bin >= low && bin <= high; }
};

struct SliceCandidate {
  std::vector<SliceCondition> conditions;  // one or two
  double score = 0;
};

// The cells that are searched; a cell is one observed finger of one touch.
struct SliceCells {
  std::vector<std::vector<uint8_t>> bin;  // [covariate][cell]
  std::vector<double> residual_s, excess_s2;
  size_t size() const { return residual_s.size(); }
};

// Sums over a part of the cells: their number, excess error (s^2) and residuals (s).
struct SliceSums {
  double count = 0, excess = 0, residual = 0;
  void operator+=(const SliceSums& other);
  SliceSums operator-(const SliceSums& other) const;
};
// The score of a part (s^2): its excess error beyond that of an average part of its size, plus what the
// difference between its mean and the mean of all cells would explain.
double SliceScore(const SliceSums& slice, const SliceSums& all);

// The best slices of at least `min_cells` of the cells listed in `live`, best first: at most one for each set
// of covariates, at most `max_slices` in all.
std::vector<SliceCandidate> SearchSlices(const std::vector<SliceBins>& bins, const SliceCells& cells,
                                         const std::vector<int>& live, int min_cells, int max_slices);

// The slice without a condition that hardly matters: one condition is easier to picture than two.
SliceCandidate Simplified(const std::vector<SliceBins>& bins, const SliceCells& cells,
                          const std::vector<int>& live, const SliceCandidate& slice);

}  // namespace touchstone::diagnosis::residuals
