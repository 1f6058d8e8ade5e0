#include "server/image/photograph/photo_lens.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <absl/strings/str_format.h>

#include "server/image/image.h"

namespace touchstone::image {
namespace {

constexpr int kLensBlock = 64;
constexpr int kMaxNewtonSteps = 12;
constexpr double kUndistortTolerance = 1e-12;  // of normalised coordinates: far below a thousandth of a pixel

// Normalised coordinates of a row's pixels, taken through the lens backwards by Newton's method, a block at a time.
struct UndistortBlock {
  alignas(64) double xd[kLensBlock], yd[kLensBlock];  // wanted
  alignas(64) double x[kLensBlock], y[kLensBlock];    // found
  alignas(64) double miss[kLensBlock];  // squared distance from the wanted, before the last step
};

void NewtonStep(const PhotoLens& lens, UndistortBlock* block) {
  const double k1 = lens.k1, k2 = lens.k2, k3 = lens.k3, p1 = lens.p1, p2 = lens.p2;
#pragma GCC ivdep
  for (int i = 0; i < kLensBlock; ++i) {
    const double x = block->x[i], y = block->y[i], r2 = x * x + y * y;
    const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
    const double slope = k1 + r2 * (2 * k2 + r2 * 3 * k3);  // d radial / d r2
    const double ex = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) - block->xd[i];
    const double ey = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y - block->yd[i];
    const double xx = radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x;
    const double xy = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y;
    const double yy = radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x;
    const double inverse = 1.0 / (xx * yy - xy * xy);
    block->x[i] = x - (yy * ex - xy * ey) * inverse;
    block->y[i] = y - (xx * ey - xy * ex) * inverse;
    block->miss[i] = ex * ex + ey * ey;
  }
}

void Undistort(const PhotoLens& lens, UndistortBlock* block) {
  std::copy_n(block->xd, kLensBlock, block->x);
  std::copy_n(block->yd, kLensBlock, block->y);
  for (int step = 0; step < kMaxNewtonSteps; ++step) {
    NewtonStep(lens, block);
    // Newton's method squares the distance: what was within the root of the tolerance is now within it.
    double worst = 0;
    for (double miss : block->miss) worst = miss > worst || !(miss == miss) ? miss : worst;
    if (worst < kUndistortTolerance) return;
  }
}

absl::Status CheckNumber(const char* field, double value, bool positive) {
  if (std::isfinite(value) && std::abs(value) <= 1e9 && (!positive || value > 0)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrFormat("lens.%s is %g; must be a finite number of pixels%s",
                                                    field, value, positive ? " greater than 0" : ""));
}

}  // namespace

Eigen::Vector2d PhotoLens::Distort(const Eigen::Vector2d& ideal) const {
  const double x = ideal.x(), y = ideal.y(), r2 = ideal.squaredNorm();
  const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  return {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
          y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
}

Eigen::Vector2d PhotoLens::Project(const Eigen::Vector3d& point_in_camera) const {
  const Eigen::Vector2d distorted = Distort(point_in_camera.head<2>() / point_in_camera.z());
  return {fx * distorted.x() + cx, fy * distorted.y() + cy};
}

Eigen::Matrix<double, 2, 3> PhotoLens::ProjectDerivative(const Eigen::Vector3d& point_in_camera) const {
  const double x = point_in_camera.x() / point_in_camera.z(), y = point_in_camera.y() / point_in_camera.z();
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double slope = k1 + r2 * (2 * k2 + r2 * 3 * k3);  // d radial / d r2
  const double across = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y;
  Eigen::Matrix2d by_ideal;
  by_ideal << fx * (radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x), fx * across, fy * across,
      fy * (radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x);
  Eigen::Matrix<double, 2, 3> ideal_by_point;
  ideal_by_point << 1, 0, -x, 0, 1, -y;
  return by_ideal * ideal_by_point / point_in_camera.z();
}

double PhotoLens::FoldRadiusSquared() const {
  // The least positive root of 1 + 3 k1 s + 5 k2 s^2 + 7 k3 s^3, s = r^2, beyond which r * radial falls.
  const auto slope = [this](double s) { return 1 + s * (3 * k1 + s * (5 * k2 + s * 7 * k3)); };
  double before = 0;
  for (double s = 1e-3; s < 1e4; s *= 1.02) {
    if (slope(s) <= 0) {
      double low = before, high = s;
      for (int i = 0; i < 60; ++i) (slope(0.5 * (low + high)) > 0 ? low : high) = 0.5 * (low + high);
      return low;
    }
    before = s;
  }
  return std::numeric_limits<double>::infinity();
}

absl::Status CheckLens(const Intrinsics& lens) {
  for (const auto& [field, side] : {std::pair("width", lens.width), std::pair("height", lens.height)}) {
    if (side < 1 || side > kMaxImageSide)
      return absl::InvalidArgumentError(
          absl::StrFormat("lens.%s is %d pixels; must be from 1 to %d", field, side, kMaxImageSide));
  }
  for (const auto& [field, value, positive] :
       {std::tuple("fx_px", lens.fx_px, true), std::tuple("fy_px", lens.fy_px, true),
        std::tuple("cx_px", lens.cx_px, false), std::tuple("cy_px", lens.cy_px, false)}) {
    if (absl::Status status = CheckNumber(field, value, positive); !status.ok()) return status;
  }
  const size_t count = lens.distortion.size();
  if (count != 0 && count != 4 && count != 5)
    return absl::InvalidArgumentError(absl::StrFormat(
        "lens.distortion has %d coefficients; must have none, 4 (k1 k2 p1 p2) or 5 (and k3)", count));
  for (double coefficient : lens.distortion)
    if (!std::isfinite(coefficient))
      return absl::InvalidArgumentError(
          absl::StrFormat("lens.distortion has the coefficient %g; must be finite", coefficient));
  return absl::OkStatus();
}

PhotoLens EffectiveLens(const Intrinsics& nominal, const effects::PhotoSettings& settings) {
  const auto coefficient = [&nominal](size_t i) {
    return i < nominal.distortion.size() ? nominal.distortion[i] : 0.0;
  };
  PhotoLens lens;
  lens.width = nominal.width, lens.height = nominal.height;
  lens.fx = nominal.fx_px * settings.focal_factor;
  lens.fy = nominal.fy_px * settings.focal_factor;
  lens.cx = nominal.cx_px + settings.principal_point_offset_px.x();
  lens.cy = nominal.cy_px + settings.principal_point_offset_px.y();
  lens.k1 = coefficient(0) + settings.k1;
  lens.k2 = coefficient(1) + settings.k2;
  lens.p1 = coefficient(2), lens.p2 = coefficient(3), lens.k3 = coefficient(4);
  return lens;
}

void FillSlopes(const PhotoLens& lens, PixelSlopes* slopes, bool* any) {
  const int width = lens.width, height = lens.height;
  slopes->right.resize(static_cast<size_t>(width) * height);
  slopes->up.resize(static_cast<size_t>(width) * height);
  if (!lens.Distorts()) {
    for (int row = 0; row < height; ++row) {
      const float up = static_cast<float>((lens.cy - row - 0.5) / lens.fy);
      float* const right_row = &slopes->right[static_cast<size_t>(row) * width];
      for (int column = 0; column < width; ++column)
        right_row[column] = static_cast<float>((column + 0.5 - lens.cx) / lens.fx);
      std::fill_n(&slopes->up[static_cast<size_t>(row) * width], width, up);
    }
    *any = true;
    return;
  }
  *any = false;
  const double fold = lens.FoldRadiusSquared();
  UndistortBlock block;
  for (int row = 0; row < height; ++row) {
    for (int first = 0; first < width; first += kLensBlock) {
      const int count = std::min(kLensBlock, width - first);
      for (int i = 0; i < kLensBlock; ++i) {
        block.xd[i] = (first + std::min(i, count - 1) + 0.5 - lens.cx) / lens.fx;
        block.yd[i] = (row + 0.5 - lens.cy) / lens.fy;
      }
      Undistort(lens, &block);
      for (int i = 0; i < count; ++i) {
        const bool seen = block.miss[i] < 1e-9 && block.x[i] * block.x[i] + block.y[i] * block.y[i] < fold;
        const size_t pixel = static_cast<size_t>(row) * width + first + i;
        slopes->right[pixel] =
            seen ? static_cast<float>(block.x[i]) : std::numeric_limits<float>::quiet_NaN();
        slopes->up[pixel] = seen ? static_cast<float>(-block.y[i]) : std::numeric_limits<float>::quiet_NaN();
        *any = *any || seen;
      }
    }
  }
}

}  // namespace touchstone::image
