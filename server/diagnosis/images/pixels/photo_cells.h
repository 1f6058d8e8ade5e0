// A photograph in cells of some pixels: sums over a cell, in units of the cell's own noise. What effects do to a picture
// is smooth over a few pixels, so cells hold what tells effects apart, and a contour that crosses a pixel no longer
// makes it jump.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "server/diagnosis/images/pixels/pixel_noise.h"

namespace touchstone::diagnosis::images {

// The variance of a contour's place within its pixel, if nothing more is known of it.
inline constexpr double kUnknownPlacePx2 = 1.0 / 12;

struct CellGrid {
  int width = 0, height = 0;  // of the picture
  int cell = 1;               // pixels along a side
  int columns() const { return (width + cell - 1) / cell; }
  int rows() const { return (height + cell - 1) / cell; }
  int size() const { return columns() * rows(); }
};

// The grid of a picture with about `cells` cells.
CellGrid GridOfPicture(int width, int height, int cells);

// The squared step of a contour at each pixel and up to two pixels around it, 0 far from contours: grey^2 for each px^2
// that its place may vary. [row * width + column]
std::vector<float> ContourSquares(const std::vector<float>& grey, int width, int height);

// 1 over the standard deviation of each cell's sum: noise of the pixels, and, near contours of the expected picture,
// what the place of a contour is worth, of which the variance is `contour_px2`. `expected_grey`: recorded on average. [cell]
Eigen::VectorXf CellWeights(const CellGrid& grid, const std::vector<float>& expected_grey,
                            const RecordTable& record, double contour_px2 = kUnknownPlacePx2);

// Sums over cells. [cell]
Eigen::VectorXf CellSums(const CellGrid& grid, const float* image);
// The same, times their weights. [cell]
Eigen::VectorXf CellSums(const CellGrid& grid, const float* image, const Eigen::VectorXf& weights);

// Over neighbouring cells, 1 2 1 in both directions.
Eigen::VectorXf Smooth(const CellGrid& grid, const Eigen::VectorXf& cells);

// Orthonormal columns that span the given ones, as far as these differ by more than `tolerance` of their length.
Eigen::MatrixXf OrthonormalSpan(const Eigen::MatrixXf& columns, double tolerance);

}  // namespace touchstone::diagnosis::images
