#include "tests/rig/world/hidden_camera.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace touchstone::rig {
namespace {

constexpr int kUndistortSteps = 100;
constexpr double kWhite = 255;
constexpr double kRadPerDeg = M_PI / 180;

struct CameraRow {
  const char* name;
  int count;
  double low, high;
  void (*set)(const std::vector<double>& values, HiddenCamera* camera);
};
const CameraRow kCameraRows[] = {
    {"camera_translation.offset_mm", 3, -100, 100,
     [](const std::vector<double>& v, HiddenCamera* c) {
       c->offset_mm = {v[0], v[1], v[2]};
     }},
    {"camera_rotation.rotation_deg", 3, -180, 180,
     [](const std::vector<double>& v, HiddenCamera* c) {
       c->rotation_deg = {v[0], v[1], v[2]};
     }},
    {"focal_error.relative", 1, -0.5, 0.5,
     [](const std::vector<double>& v, HiddenCamera* c) { c->focal_relative = v[0]; }},
    {"principal_point.offset_px", 2, -200, 200,
     [](const std::vector<double>& v, HiddenCamera* c) {
       c->principal_px = {v[0], v[1]};
     }},
    {"radial_distortion.k1", 1, -0.5, 0.5,
     [](const std::vector<double>& v, HiddenCamera* c) { c->k1 = v[0]; }},
    {"radial_distortion.k2", 1, -0.5, 0.5,
     [](const std::vector<double>& v, HiddenCamera* c) { c->k2 = v[0]; }},
    {"background_level.grey", 1, 0, 255,
     [](const std::vector<double>& v, HiddenCamera* c) { c->ground_grey = v[0]; }},
    {"vignetting.strength", 1, 0, 1,
     [](const std::vector<double>& v, HiddenCamera* c) { c->vignetting = v[0]; }},
    {"defocus_blur.sigma_px", 1, 0, 20,
     [](const std::vector<double>& v, HiddenCamera* c) { c->defocus_px = v[0]; }},
    {"exposure.stops", 1, -4, 4, [](const std::vector<double>& v, HiddenCamera* c) { c->stops = v[0]; }},
    {"gamma.exponent", 1, 0.2, 5, [](const std::vector<double>& v, HiddenCamera* c) { c->gamma = v[0]; }},
    {"image_noise.sigma_grey", 1, 0, 50,
     [](const std::vector<double>& v, HiddenCamera* c) { c->sigma_grey = v[0]; }},
    {"image_noise.gain", 1, 0, 10,
     [](const std::vector<double>& v, HiddenCamera* c) { c->noise_gain = v[0]; }},
};

std::vector<double> CameraNumbers(const std::string& text, const std::string& whole, const CameraRow& row) {
  std::vector<double> numbers;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t comma = std::min(text.find(',', begin), text.size());
    const std::string word = text.substr(begin, comma - begin);
    size_t used = 0;
    double value = NAN;
    try {
      value = std::stod(word, &used);
    } catch (const std::exception&) {
    }
    if (word.empty() || used != word.size() || !(value >= row.low && value <= row.high))
      throw std::invalid_argument("'" + whole + "': '" + word + "' is no number from " +
                                  std::to_string(row.low) + " to " + std::to_string(row.high));
    numbers.push_back(value);
    begin = comma + 1;
  }
  if (static_cast<int>(numbers.size()) != row.count)
    throw std::invalid_argument("'" + whole + "': " + std::to_string(numbers.size()) + " numbers, must be " +
                                std::to_string(row.count));
  return numbers;
}

// The point of the ideal picture that a lens of k1, k2 shows at x: x = ideal (1 + k1 r^2 + k2 r^4), by the fixed point
// that OpenCV's undistortPoints iterates too.
Eigen::Vector2d Undistorted(const Eigen::Vector2d& x, double k1, double k2) {
  Eigen::Vector2d ideal = x;
  for (int step = 0; step < kUndistortSteps; ++step) {
    const double r2 = ideal.squaredNorm();
    const Eigen::Vector2d next = x / (1 + k1 * r2 + k2 * r2 * r2);
    if (!next.allFinite() || next.norm() > 1e3) return next;
    if ((next - ideal).norm() < 1e-12) return next;
    ideal = next;
  }
  return ideal;
}

void BlurAlong(int step_x, int step_y, double sigma, Light* light) {
  const int reach = std::max(1, static_cast<int>(std::ceil(4 * sigma)));
  std::vector<double> weight(2 * reach + 1);
  double sum = 0;
  for (int k = -reach; k <= reach; ++k) sum += weight[k + reach] = std::exp(-0.5 * k * k / (sigma * sigma));
  const Light sharp = *light;
  for (int y = 0; y < light->height; ++y)
    for (int x = 0; x < light->width; ++x) {
      double level = 0;
      for (int k = -reach; k <= reach; ++k) {
        const int i = std::clamp(x + k * step_x, 0, light->width - 1),
                  j = std::clamp(y + k * step_y, 0, light->height - 1);
        level += weight[k + reach] * sharp.level[static_cast<size_t>(j) * light->width + i];
      }
      light->level[static_cast<size_t>(y) * light->width + x] = level / sum;
    }
}

}  // namespace

std::string HiddenCameraNames() {
  std::string names;
  for (const CameraRow& row : kCameraRows) names += (names.empty() ? "" : ", ") + std::string(row.name);
  return names;
}

bool HideInCamera(const std::string& assignment, HiddenCamera* camera) {
  const size_t equals = std::min(assignment.find('='), assignment.size());
  const std::string name = assignment.substr(0, equals), effect = name.substr(0, name.find('.'));
  std::string known;
  for (const CameraRow& row : kCameraRows) {
    const std::string each = row.name;
    if (each == name && equals < assignment.size()) {
      row.set(CameraNumbers(assignment.substr(equals + 1), assignment, row), camera);
      return true;
    }
    if (each.substr(0, each.find('.')) == effect) known += (known.empty() ? "" : ", ") + each;
  }
  if (known.empty()) return false;
  throw std::invalid_argument("'" + assignment + "' must look like EFFECT.PARAMETER=VALUE; of " + effect +
                              " there are " + known);
}

Eigen::Affine3d RealPose(const HiddenCamera& hidden, const Eigen::Affine3d& from_camera) {
  const Eigen::Vector3d turn = hidden.rotation_deg * kRadPerDeg;
  Eigen::Affine3d real = from_camera * Eigen::Translation3d(hidden.offset_mm * 1e-3);
  if (turn.norm() > 0) real = real * Eigen::AngleAxisd(turn.norm(), turn.normalized());
  return real;
}

Light ThroughLens(const HiddenCamera& hidden, int width, int height, double vertical_fov_rad,
                  const LightAlong& light_along) {
  const double focal = 0.5 * height / std::tan(0.5 * vertical_fov_rad) * (1 + hidden.focal_relative);
  const Eigen::Vector2d principal(0.5 * width + hidden.principal_px.x(),
                                  0.5 * height + hidden.principal_px.y());
  std::vector<Eigen::Vector2d> rays;
  rays.reserve(static_cast<size_t>(width) * height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      rays.push_back(Undistorted({(x + 0.5 - principal.x()) / focal, (y + 0.5 - principal.y()) / focal},
                                 hidden.k1, hidden.k2));
  return {width, height, light_along(rays)};
}

void Develop(const HiddenCamera& hidden, Light* light) {
  const Eigen::Vector2d principal(0.5 * light->width + hidden.principal_px.x(),
                                  0.5 * light->height + hidden.principal_px.y());
  const double half_diagonal = 0.5 * std::hypot(light->width, light->height);
  if (hidden.vignetting != 0)
    for (int y = 0; y < light->height; ++y)
      for (int x = 0; x < light->width; ++x) {
        const double r = std::hypot(x + 0.5 - principal.x(), y + 0.5 - principal.y()) / half_diagonal;
        light->level[static_cast<size_t>(y) * light->width + x] *= 1 - hidden.vignetting * r * r;
      }
  if (hidden.defocus_px > 0) {
    BlurAlong(1, 0, hidden.defocus_px, light);
    BlurAlong(0, 1, hidden.defocus_px, light);
  }
  for (double& level : light->level) {
    level = std::clamp(level * std::exp2(hidden.stops), 0.0, 1.0);
    if (hidden.gamma != 1) level = std::pow(level, hidden.gamma);
  }
}

std::vector<uint8_t> Record(const HiddenCamera& hidden, const Light& light, std::mt19937_64* random) {
  std::normal_distribution<double> normal;
  std::vector<uint8_t> pixels;
  pixels.reserve(light.level.size());
  const double sigma = hidden.sigma_grey.value_or(0);
  for (const double level : light.level) {
    const double grey = kWhite * level;
    const double noise = normal(*random) * std::sqrt(sigma * sigma + hidden.noise_gain * grey);
    pixels.push_back(static_cast<uint8_t>(std::clamp(std::round(grey + noise), 0.0, kWhite)));
  }
  return pixels;
}

}  // namespace touchstone::rig
