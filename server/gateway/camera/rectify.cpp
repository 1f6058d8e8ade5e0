#include <algorithm>
#include <cmath>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "server/base/check.h"
#include "server/gateway/camera/camera.h"

namespace touchstone::gateway::camera {
namespace {

constexpr int kMaxSamples = 8;  // a side, of one pixel

// Radial part of the distortion: distance from the axis on the sensor, of a ray at that distance.
double Radial(const std::vector<double>& k, double r) {
  const auto at = [&](size_t i) { return i < k.size() ? k[i] : 0; };
  const double r2 = r * r;
  return r * (1 + r2 * (at(0) + r2 * (at(1) + r2 * at(4)))) / (1 + r2 * (at(5) + r2 * (at(6) + r2 * at(7))));
}

// The polynomial holds only where it grows: beyond, rays that the camera never saw would fold back
// into the picture.
double FoldsAt(const std::vector<double>& k, double most) {
  constexpr int kSteps = 1000;
  double before = 0;
  for (int i = 1; i <= kSteps; ++i) {
    const double r = most * i / kSteps, here = Radial(k, r);
    if (!(here > before)) return most * (i - 1) / kSteps;
    before = here;
  }
  return most;
}

}  // namespace

std::vector<uint8_t> Rectify(const image::Frame& frame, const image::Intrinsics& intrinsics, int width,
                             int height, double vertical_fov_rad, bool grey) {
  TOUCHSTONE_CHECK(width > 0 && height > 0 && vertical_fov_rad > 0 && vertical_fov_rad < 3.1);
  TOUCHSTONE_CHECK(frame.width > 0 && frame.height > 0 &&
                   frame.rgb.size() == static_cast<size_t>(frame.width) * frame.height * 3);
  // The frame's own lens, at the frame's size; without intrinsics an ideal one of the same field of view.
  double fx = frame.height / (2 * std::tan(0.5 * vertical_fov_rad)), fy = fx;
  double cx = 0.5 * (frame.width - 1), cy = 0.5 * (frame.height - 1);
  if (intrinsics.fx_px > 0) {
    const image::Intrinsics scaled = image::ScaledTo(intrinsics, frame.width, frame.height);
    fx = scaled.fx_px, fy = scaled.fy_px, cx = scaled.cx_px, cy = scaled.cy_px;
  }
  const double focal = height / (2 * std::tan(0.5 * vertical_fov_rad));

  // Where the source is finer, several samples a pixel, or thin lines would flicker.
  const int samples =
      std::clamp(static_cast<int>(std::ceil(std::max(fx, fy) / focal - 0.05)), 1, kMaxSamples);
  const int fine_width = width * samples, fine_height = height * samples;
  const cv::Matx33d from(fx, 0, cx, 0, fy, cy, 0, 0, 1);
  const cv::Matx33d to(focal * samples, 0, 0.5 * (fine_width - 1), 0, focal * samples,
                       0.5 * (fine_height - 1), 0, 0, 1);
  cv::Mat map_x, map_y;
  cv::initUndistortRectifyMap(from, intrinsics.distortion, cv::noArray(), to,
                              cv::Size(fine_width, fine_height), CV_32FC1, map_x, map_y);
  const double corner = std::hypot(fine_width, fine_height) / (2 * focal * samples);
  const double folds_at = FoldsAt(intrinsics.distortion, corner);
  if (folds_at < corner) {
    for (int y = 0; y < fine_height; ++y)
      for (int x = 0; x < fine_width; ++x)
        if (std::hypot(x - to(0, 2), y - to(1, 2)) > folds_at * to(0, 0))
          map_x.at<float>(y, x) = map_y.at<float>(y, x) = -10;
  }

  const cv::Mat source(frame.height, frame.width, CV_8UC3, const_cast<uint8_t*>(frame.rgb.data()));
  cv::Mat fine;
  cv::remap(source, fine, map_x, map_y, cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar(0, 0, 0));
  if (samples > 1) cv::resize(fine, fine, cv::Size(width, height), 0, 0, cv::INTER_AREA);
  if (grey) cv::cvtColor(fine, fine, cv::COLOR_RGB2GRAY);
  return std::vector<uint8_t>(fine.data, fine.data + fine.total() * fine.elemSize());
}

}  // namespace touchstone::gateway::camera
