#include "server/image/normalize/normalize_ground.h"

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <tuple>

#include "server/base/units.h"

namespace touchstone::image {
namespace {

// Grey levels that the sensor's noise is cut off at: below 3 standard deviations of most cameras' noise.
constexpr float kBlack = 10, kWhite = 245, kMaxHiddenNoise = 4;
constexpr int kTerms = 10;
constexpr double kGroundShare = 0.06;  // of the ground's grey: so near it a pixel is counted as ground
constexpr double kMinGain = 1.2;       // of such pixels, for a ground that is followed from farther away
using Terms = Eigen::Matrix<double, kTerms, 1>;

// Polynomial terms at a pixel, coordinates from -1 to 1.
Terms TermsAt(const Plane& plane, int column, int row) {
  const double x = 2.0 * (column + 0.5) / plane.width - 1, y = 2.0 * (row + 0.5) / plane.height - 1;
  Terms terms;
  terms << 1, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y;
  return terms;
}

float MedianOf(std::vector<float>* values) {
  if (values->empty()) return 0;
  const auto middle = values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

int RimOf(const Plane& plane) {
  return std::max(2, std::min(plane.width, plane.height) / 24);
}
bool OnRim(const Plane& plane, int rim, int x, int y) {
  return x < rim || y < rim || x >= plane.width - rim || y >= plane.height - rim;
}

struct GroundSample {
  int x, y;
  float grey;
};

// Least squares over the samples; the terms that they do not determine stay small (a ridge).
Terms FitTerms(const Plane& plane, const std::vector<GroundSample>& samples, int terms) {
  Eigen::Matrix<double, kTerms, kTerms> normal = Eigen::Matrix<double, kTerms, kTerms>::Zero();
  Terms right = Terms::Zero();
  for (const GroundSample& sample : samples) {
    Terms row = TermsAt(plane, sample.x, sample.y);
    row.tail(kTerms - terms).setZero();
    normal.noalias() += row * row.transpose();
    right += sample.grey * row;
  }
  normal.diagonal().array() += 1e-6 * std::max<double>(static_cast<double>(samples.size()), 1);
  return normal.ldlt().solve(right);
}

// How far a pixel of the ground may lie from a surface that is `expected` there.
// Little on a dark ground: a surface that may bend would follow its shadow.
double ToleranceAt(double expected, float noise, double share) {
  return 2.5 * noise + 0.6 + share * std::abs(expected);
}

std::vector<GroundSample> Agreeing(const Plane& plane, const std::vector<GroundSample>& samples,
                                   const Terms& fit, float noise, double share) {
  std::vector<GroundSample> agreeing;
  for (const GroundSample& sample : samples) {
    const double expected = fit.dot(TermsAt(plane, sample.x, sample.y));
    if (std::abs(sample.grey - expected) < ToleranceAt(expected, noise, share)) agreeing.push_back(sample);
  }
  return agreeing;
}

// The plane with which most of the rim agrees, among those through the medians of three of twelve stretches of it: what
// lies on a third of the rim (a shadow, the object) does not count.
Terms ConsensusPlane(const Plane& plane, const std::vector<GroundSample>& rim, float noise) {
  constexpr int kStretches = 12;
  std::array<std::vector<GroundSample>, kStretches> stretches;
  for (const GroundSample& sample : rim) {
    const double angle = std::atan2(sample.y + 0.5 - 0.5 * plane.height, sample.x + 0.5 - 0.5 * plane.width);
    const int stretch = static_cast<int>((angle + kPi) / (2 * kPi) * kStretches);
    stretches[std::clamp(stretch, 0, kStretches - 1)].push_back(sample);
  }
  std::vector<GroundSample> medians;
  for (std::vector<GroundSample>& stretch : stretches) {
    if (stretch.empty()) continue;
    const auto middle = stretch.begin() + static_cast<std::ptrdiff_t>(stretch.size() / 2);
    std::nth_element(stretch.begin(), middle, stretch.end(),
                     [](const GroundSample& a, const GroundSample& b) {
                       return std::tie(a.grey, a.y, a.x) < std::tie(b.grey, b.y, b.x);
                     });
    medians.push_back(*middle);
  }
  Terms best = Terms::Zero();
  size_t most = 0;
  for (size_t i = 0; i < medians.size(); ++i)
    for (size_t j = i + 1; j < medians.size(); ++j)
      for (size_t k = j + 1; k < medians.size(); ++k) {
        const Terms fit = FitTerms(plane, {medians[i], medians[j], medians[k]}, 3);
        const size_t agreeing = Agreeing(plane, rim, fit, noise, 0.06).size();
        if (agreeing <= most) continue;
        most = agreeing;
        best = fit;
      }
  return best;
}

}  // namespace

Plane Blurred(const Plane& plane, float sigma_px) {
  const int reach = std::max(1, static_cast<int>(std::ceil(3 * sigma_px)));
  std::vector<float> kernel(2 * reach + 1);
  float sum = 0;
  for (int k = -reach; k <= reach; ++k)
    sum += kernel[k + reach] = std::exp(-0.5f * k * k / (sigma_px * sigma_px));
  for (float& weight : kernel) weight /= sum;
  Plane across(plane.width, plane.height), both(plane.width, plane.height);
  for (int y = 0; y < plane.height; ++y)
    for (int x = 0; x < plane.width; ++x) {
      float value = 0;
      for (int k = -reach; k <= reach; ++k)
        value += kernel[k + reach] * plane.at(std::clamp(x + k, 0, plane.width - 1), y);
      across.at(x, y) = value;
    }
  for (int y = 0; y < plane.height; ++y)
    for (int x = 0; x < plane.width; ++x) {
      float value = 0;
      for (int k = -reach; k <= reach; ++k)
        value += kernel[k + reach] * across.at(x, std::clamp(y + k, 0, plane.height - 1));
      both.at(x, y) = value;
    }
  return both;
}

Plane WithoutNoise(const Plane& grey, float noise) {
  constexpr int kReach = 3;
  const float limit = std::max(3 * noise, 1.0f);
  Plane result(grey.width, grey.height);
  for (int y = 0; y < grey.height; ++y)
    for (int x = 0; x < grey.width; ++x) {
      const float own = grey.at(x, y);
      float sum = 0;
      int count = 0;
      for (int row = std::max(y - kReach, 0); row <= std::min(y + kReach, grey.height - 1); ++row)
        for (int column = std::max(x - kReach, 0); column <= std::min(x + kReach, grey.width - 1); ++column) {
          const float value = grey.at(column, row);
          const bool alike = std::abs(value - own) <= limit;
          sum += alike ? value : 0;
          count += alike;
        }
      result.at(x, y) = sum / static_cast<float>(count);
    }
  return result;
}

float NoiseOf(const Plane& grey) {
  // The mask 1 -2 1 / -2 4 -2 / 1 -2 1 of white noise has 6 times its standard deviation.
  std::vector<float> sizes, unclipped;
  sizes.reserve(grey.values.size());
  for (int y = 1; y + 1 < grey.height; ++y)
    for (int x = 1; x + 1 < grey.width; ++x) {
      sizes.push_back(std::abs(grey.at(x - 1, y - 1) - 2 * grey.at(x, y - 1) + grey.at(x + 1, y - 1) -
                               2 * grey.at(x - 1, y) + 4 * grey.at(x, y) - 2 * grey.at(x + 1, y) +
                               grey.at(x - 1, y + 1) - 2 * grey.at(x, y + 1) + grey.at(x + 1, y + 1)));
      if (grey.at(x, y) >= kBlack && grey.at(x, y) <= kWhite) unclipped.push_back(sizes.back());
    }
  const size_t pixels = sizes.size();
  const auto noise_of = [](std::vector<float>* values) { return 1.4826f * MedianOf(values) / 6; };
  const float noise = noise_of(&sizes);
  // Black and white cut noise off: what most of a dark ground shows is less than the sensor's. Where enough of the picture
  // is neither, that tells; but its texture is in it too, so that it is used up to a limit.
  if (unclipped.size() < pixels / 20 || unclipped.size() > pixels / 2) return noise;
  return std::max(noise, std::min(noise_of(&unclipped), kMaxHiddenNoise));
}

Plane FitGround(const Plane& grey, float noise) {
  const int rim_width = RimOf(grey), step = std::max(1, std::min(grey.width, grey.height) / 112);
  std::vector<GroundSample> rim, all;
  for (int y = 0; y < grey.height; y += step)
    for (int x = 0; x < grey.width; x += step) {
      const GroundSample sample{x, y, grey.at(x, y)};
      all.push_back(sample);
      if (OnRim(grey, rim_width, x, y)) rim.push_back(sample);
    }
  Terms fit = ConsensusPlane(grey, rim, noise);
  // Light that falls off bends the rim away from a plane, then the middle away from the rim.
  for (const double share : {0.12, 0.08, 0.05, 0.04})
    fit = FitTerms(grey, Agreeing(grey, rim, fit, noise, share), 6);
  const Terms from_rim = fit;
  const auto follow = [&](const std::initializer_list<double>& shares) {
    fit = from_rim;
    for (const double share : shares) {
      const std::vector<GroundSample> agreeing = Agreeing(grey, all, fit, noise, share);
      if (agreeing.size() < all.size() / 20) break;
      fit = FitTerms(grey, agreeing, share > 0.05 ? 6 : kTerms);
    }
    return Agreeing(grey, all, fit, noise, kGroundShare).size();
  };
  const size_t near = follow({0.10, 0.06, 0.04, 0.03, 0.03});
  const Terms near_fit = fit;
  // Light that falls off faster than the rim tells is followed from farther away; that has to pay.
  const size_t far = follow({0.5, 0.4, 0.3, 0.2, 0.15, 0.10, 0.08, 0.05, 0.04, 0.03});
  if (static_cast<double>(far) < kMinGain * static_cast<double>(near)) fit = near_fit;
  Plane ground(grey.width, grey.height);
  for (int y = 0; y < grey.height; ++y)
    for (int x = 0; x < grey.width; ++x)
      ground.at(x, y) = std::clamp(static_cast<float>(fit.dot(TermsAt(grey, x, y))), 0.0f, 255.0f);
  return ground;
}

Plane GroundOf(const Plane& background, const Plane& grey) {
  Plane ground = Blurred(background, 0.7f);
  std::vector<float> ratios;
  const int rim = RimOf(grey);
  for (int y = 0; y < grey.height; ++y)
    for (int x = 0; x < grey.width; ++x)
      if (OnRim(grey, rim, x, y) && ground.at(x, y) > 8) ratios.push_back(grey.at(x, y) / ground.at(x, y));
  if (ratios.empty()) return ground;
  const float exposure = std::clamp(MedianOf(&ratios), 0.25f, 4.0f);
  for (float& value : ground.values) value = std::min(value * exposure, 255.0f);
  return ground;
}

}  // namespace touchstone::image
