// What pictures say of the kinds of what a model leaves (photo_rest_kinds.h): sums over their pixels.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <numeric>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "server/diagnosis/images/rows/rules.h"
#include "server/diagnosis/images/rules.h"

namespace touchstone::diagnosis::images {

inline constexpr int kKindFolds = 5;     // of the poses
inline constexpr int kPlaceColumns = 4;  // right, down, and each growing from row to row

// Sums of a least-squares fit of a few columns to residuals.
template <int kColumns>
struct KindSums {
  Eigen::Matrix<double, kColumns, kColumns> squares = Eigen::Matrix<double, kColumns, kColumns>::Zero();
  Eigen::Matrix<double, kColumns, 1> cross = Eigen::Matrix<double, kColumns, 1>::Zero();

  void Add(const Eigen::Matrix<double, kColumns, 1>& column, double residual) {
    squares += column * column.transpose();
    cross += column * residual;
  }
  void Add(const KindSums& other) { squares += other.squares, cross += other.cross; }
  void Remove(const KindSums& other) { squares -= other.squares, cross -= other.cross; }
  Eigen::Matrix<double, kColumns, 1> Solve() const {
    auto ridge = squares;
    ridge.diagonal().array() += 1e-9 * squares.trace() + 1e-12;
    return ridge.ldlt().solve(cross);
  }
  // Squares that these values take.
  double Taken(const Eigen::Matrix<double, kColumns, 1>& values) const {
    return 2 * values.dot(cross) - values.dot(squares * values);
  }
};

// Of one cell: light that is added, and a share of the light.
struct Cells {
  std::vector<double> count, sum, grey_squares, grey_cross;
  explicit Cells(size_t cells) : count(cells), sum(cells), grey_squares(cells), grey_cross(cells) {}
  void Add(size_t cell, double grey, double residual) {
    count[cell] += 1, sum[cell] += residual;
    grey_squares[cell] += grey * grey, grey_cross[cell] += grey * residual;
  }
};

// What one picture says.
struct PictureSums {
  std::array<KindSums<1>, 2> light;              // by half of the blocks
  std::array<KindSums<kPlaceColumns>, 2> place;  // the same
  KindSums<1> contours;
  Cells in_picture{static_cast<size_t>(kPhotoRowRules.map_cells * kPhotoRowRules.map_cells)};
  Cells on_object{
      static_cast<size_t>(kImageRules.object_cells * kImageRules.object_cells * kImageRules.object_cells)};
  double squares = 0, noise = 0;  // the second: expected of noise alone

  double Excess() const { return std::max(squares - noise, 0.0); }
};

// What the cells of other folds take from each fold, added light or a share of it, whichever is better.
inline double TakenByCells(const std::vector<const Cells*>& pictures, const std::vector<int>& fold) {
  if (pictures.empty()) return 0;
  double added = 0, shared = 0;
  for (size_t cell = 0; cell < pictures[0]->count.size(); ++cell) {
    std::array<double, kKindFolds> count{}, sum{}, squares{}, cross{};
    for (size_t k = 0; k < pictures.size(); ++k) {
      count[fold[k]] += pictures[k]->count[cell], sum[fold[k]] += pictures[k]->sum[cell];
      squares[fold[k]] += pictures[k]->grey_squares[cell], cross[fold[k]] += pictures[k]->grey_cross[cell];
    }
    const auto total = [](const auto& of) { return std::accumulate(of.begin(), of.end(), 0.0); };
    const double mean_square = total(squares) / std::max(total(count), 1.0);
    for (int f = 0; f < kKindFolds; ++f) {
      const double value = (total(sum) - sum[f]) / (total(count) - count[f] + kPhotoRowRules.shrinkage_px);
      added += 2 * value * sum[f] - value * value * count[f];
      const double factor = (total(cross) - cross[f]) /
                            (total(squares) - squares[f] + kPhotoRowRules.shrinkage_px * mean_square + 1e-9);
      shared += 2 * factor * cross[f] - factor * factor * squares[f];
    }
  }
  return std::max(added, shared);
}

}  // namespace touchstone::diagnosis::images
