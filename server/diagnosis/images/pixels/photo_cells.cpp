#include "server/diagnosis/images/pixels/photo_cells.h"

#include <algorithm>
#include <cmath>

#include "server/base/numbers/decompositions.h"
#include "server/diagnosis/images/pixels/rules.h"

namespace touchstone::diagnosis::images {
namespace {

// The mean of a clipped pixel is as good as what is known of its noise there: it counts as if it scattered so much.

// The largest over each pixel and its neighbours.
std::vector<float> LargestAround(const std::vector<float>& image, int width, int height) {
  std::vector<float> along(image.size()), around(image.size());
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const float* row = &image[static_cast<size_t>(y) * width];
      along[static_cast<size_t>(y) * width + x] =
          std::max({row[std::max(x - 1, 0)], row[x], row[std::min(x + 1, width - 1)]});
    }
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const auto at = [&](int row) { return along[static_cast<size_t>(row) * width + x]; };
      around[static_cast<size_t>(y) * width + x] =
          std::max({at(std::max(y - 1, 0)), at(y), at(std::min(y + 1, height - 1))});
    }
  return around;
}

}  // namespace

std::vector<float> ContourSquares(const std::vector<float>& grey, int width, int height) {
  const std::vector<float> most = LargestAround(grey, width, height);
  std::vector<float> negative(grey.size());
  for (size_t i = 0; i < grey.size(); ++i) negative[i] = -grey[i];
  const std::vector<float> least = LargestAround(negative, width, height);
  std::vector<float> squares(grey.size());
  for (size_t i = 0; i < grey.size(); ++i) {
    const double step =
        std::max(static_cast<double>(most[i]) + least[i] - kPixelRules.contour_step_grey, 0.0);
    squares[i] = static_cast<float>(step * step);
  }
  return LargestAround(squares, width, height);
}

CellGrid GridOfPicture(int width, int height, int cells) {
  CellGrid grid{width, height, 1};
  while (grid.size() > cells) ++grid.cell;
  return grid;
}

Eigen::VectorXf CellWeights(const CellGrid& grid, const std::vector<float>& grey, const RecordTable& record,
                            double contour_px2) {
  const std::vector<float> contour = ContourSquares(grey, grid.width, grid.height);
  Eigen::VectorXf variance = Eigen::VectorXf::Zero(grid.size());
  for (int y = 0; y < grid.height; ++y)
    for (int x = 0; x < grid.width; ++x) {
      const size_t pixel = static_cast<size_t>(y) * grid.width + x;
      const double variance_here = record.Variance(grey[pixel]);
      const double clipped = kPixelRules.clipped_sigmas * kPixelRules.clipped_sigmas * variance_here *
                             record.Clipped(grey[pixel]);
      variance[y / grid.cell * grid.columns() + x / grid.cell] +=
          static_cast<float>(contour_px2 * contour[pixel] + variance_here + clipped);
    }
  return variance.cwiseSqrt().cwiseInverse();
}

Eigen::VectorXf CellSums(const CellGrid& grid, const float* image) {
  Eigen::VectorXf sums(grid.size());
  Eigen::VectorXf down(grid.width);
  for (int row = 0; row < grid.rows(); ++row) {
    // Down the columns of pixels first: many at a time.
    down.setZero();
    for (int y = row * grid.cell; y < std::min((row + 1) * grid.cell, grid.height); ++y)
      down += Eigen::Map<const Eigen::VectorXf>(image + static_cast<size_t>(y) * grid.width, grid.width);
    for (int column = 0; column < grid.columns(); ++column) {
      const int end = std::min((column + 1) * grid.cell, grid.width);
      float sum = 0;
      for (int x = column * grid.cell; x < end; ++x) sum += down[x];
      sums[row * grid.columns() + column] = sum;
    }
  }
  return sums;
}

Eigen::VectorXf CellSums(const CellGrid& grid, const float* image, const Eigen::VectorXf& weights) {
  return CellSums(grid, image).cwiseProduct(weights);
}

Eigen::VectorXf Smooth(const CellGrid& grid, const Eigen::VectorXf& cells) {
  const int columns = grid.columns(), rows = grid.rows();
  Eigen::VectorXf along(cells.size()), both(cells.size());
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x) {
      const int row = y * columns;
      along[row + x] = 0.5f * cells[row + x] +
                       0.25f * (cells[row + std::max(x - 1, 0)] + cells[row + std::min(x + 1, columns - 1)]);
    }
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x)
      both[y * columns + x] =
          0.5f * along[y * columns + x] +
          0.25f * (along[std::max(y - 1, 0) * columns + x] + along[std::min(y + 1, rows - 1) * columns + x]);
  return both;
}

Eigen::MatrixXf OrthonormalSpan(const Eigen::MatrixXf& columns, double tolerance) {
  Eigen::MatrixXf unit = columns;
  int used = 0;
  for (int c = 0; c < columns.cols(); ++c) {
    const float norm = columns.col(c).norm();
    if (norm > 1e-6f) unit.col(used++) = columns.col(c) / norm;
  }
  unit.conservativeResize(Eigen::NoChange, used);
  const Eigen::MatrixXd gram = (unit.transpose() * unit).cast<double>();
  const SymmetricEigen eigen = EigenOfSymmetric(gram);
  int kept = 0;
  for (int i = 0; i < used; ++i) kept += eigen.values[i] > tolerance;
  const Eigen::MatrixXd turned =
      eigen.vectors.rightCols(kept) * eigen.values.tail(kept).cwiseSqrt().cwiseInverse().asDiagonal();
  return unit * turned.cast<float>();
}

}  // namespace touchstone::diagnosis::images
