#include "server/diagnosis/images/pixels/pixel_noise.h"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "server/diagnosis/images/pixels/rules.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr double kWhite = 255, kGreyLevels = 256;
constexpr int kPerGrey = 8;  // entries of a table
constexpr int kEntries = 255 * kPerGrey + 1;
constexpr double kRoundingVariance = 1.0 / 12;
constexpr size_t kBlock = 64;             // pixels that are looked at together
constexpr double kKeptVariance = 0.4377;  // mean square of the smallest 80 % of normal numbers

// Of the smallest kept_share of a histogram: their mean square, scaled to a normal number's variance.
double TrimmedVariance(const double* counts, const double* squares, int steps) {
  double total = 0;
  for (int s = 0; s < steps; ++s) total += counts[s];
  double left = kPixelRules.kept_share * total, sum = 0;
  for (int s = 0; s < steps && left > 0; ++s) {
    if (counts[s] == 0) continue;
    const double taken = std::min(left, counts[s]);
    sum += squares[s] * taken / counts[s];
    left -= taken;
  }
  return total > 0 ? sum / (kPixelRules.kept_share * total) / kKeptVariance : 0;
}

// Levels whose pixels are hardly ever clipped: what is cut at black or white scatters too little. Where every level is
// clipped, the one farthest from black and white.
std::vector<LevelScatter> Unclipped(const std::vector<LevelScatter>& levels, double bin_grey) {
  if (levels.empty()) return levels;
  const auto room = [&](const LevelScatter& level) {
    return std::min(level.grey, kWhite - level.grey) - 0.5 * bin_grey;
  };
  std::vector<LevelScatter> kept;
  for (const LevelScatter& level : levels)
    if (room(level) > 0 && room(level) >= kPixelRules.clipped_bin * std::sqrt(level.variance))
      kept.push_back(level);
  if (!kept.empty()) return kept;
  return {*std::max_element(levels.begin(), levels.end(),
                            [&](const auto& a, const auto& b) { return room(a) < room(b); })};
}

double Tail(double z) {  // P(Z > z)
  return 0.5 * std::erfc(z * 0.7071067811865476);
}

}  // namespace

RecordedPixel Record(double grey, const PixelNoise& noise) {
  const double variance = std::max(noise.Variance(grey), kRoundingVariance);
  const double sigma = std::sqrt(variance);
  const double low = -grey / sigma, high = (kWhite - grey) / sigma;
  if (low < -kPixelRules.clipped_from && high > kPixelRules.clipped_from) return {grey, variance, 0};
  // The record is the light with its scatter, rounded, then cut at the ends: sums of the tails of its levels. (Cut before
  // it is rounded, its mean at black would be a sixtieth of a grey level higher, which weighs millions of pixels.)
  const double unrounded = std::sqrt(std::max(variance - kRoundingVariance, kRoundingVariance));
  double mean = 0, square = 0;
  for (int level = 1; level <= static_cast<int>(kWhite); ++level) {
    const double reaches = Tail((level - 0.5 - grey) / unrounded);
    if (reaches < kPixelRules.no_tail) break;
    mean += reaches;
    square += (2 * level - 1) * reaches;
  }
  return {mean, std::max(square - mean * mean, 0.0) + 0.02 * kRoundingVariance, 1 - (Tail(low) - Tail(high))};
}

RecordTable::RecordTable(const PixelNoise& noise) : noise_(noise), variance_(kEntries), clipped_(kEntries) {
  std::vector<RecordedPixel> by_grey;
  for (int i = 0; i < kEntries; ++i) {
    by_grey.push_back(Record(static_cast<double>(i) / kPerGrey, noise));
    mean_.push_back(static_cast<float>(by_grey.back().mean_grey));
  }
  const auto kept = [&](int i) { return by_grey[i].mean_grey == static_cast<double>(i) / kPerGrey; };
  int first = kEntries / 2, last = first;
  if (kept(first)) {
    while (first > 0 && kept(first - 1)) --first;
    while (last + 1 < kEntries && kept(last + 1)) ++last;
    first_kept_grey_ = static_cast<float>(first) / kPerGrey;
    last_kept_grey_ = static_cast<float>(last) / kPerGrey;
  }
  int from = 0;
  for (int i = 0; i < kEntries; ++i) {
    while (from + 1 < kEntries && by_grey[from + 1].mean_grey <= static_cast<double>(i) / kPerGrey) ++from;
    variance_[i] = static_cast<float>(by_grey[from].variance);
    clipped_[i] = static_cast<float>(by_grey[from].clipped);
  }
}

float RecordTable::Mean(float grey) const {
  const float place = std::clamp(grey, 0.0f, static_cast<float>(kWhite)) * kPerGrey;
  const int below = std::min(static_cast<int>(place), kEntries - 2);
  return mean_[below] + (place - static_cast<float>(below)) * (mean_[below + 1] - mean_[below]);
}

void RecordTable::ToMeans(float* grey, size_t size) const {
  // A diagnosis does this for every pixel that it expects, and most of them are grey levels that no clipping changes
  // (interpolating gives them back exactly), or a ground that is the same everywhere.
  float ground = std::numeric_limits<float>::quiet_NaN(), ground_mean = 0;
  const float first = first_kept_grey_, last = last_kept_grey_;
  for (size_t begin = 0; begin < size; begin += kBlock) {
    float* const values = grey + begin;
    const int count = static_cast<int>(std::min<size_t>(kBlock, size - begin));
    const Eigen::Map<const Eigen::ArrayXf> block(values, count);
    const float lowest = block.minCoeff(), highest = block.maxCoeff();
    if (lowest >= first && highest <= last) continue;
    if (lowest == highest) {
      std::fill_n(values, count, Mean(lowest));
      continue;
    }
    for (int i = 0; i < count; ++i) {
      if (values[i] >= first && values[i] <= last) continue;
      if (values[i] != ground) {
        ground = values[i];
        ground_mean = Mean(ground);
      }
      values[i] = ground_mean;
    }
  }
}

double RecordTable::At(const std::vector<float>& values, double mean) const {
  const int entry = static_cast<int>(mean * kPerGrey + 0.5);
  return values[std::clamp(entry, 0, kEntries - 1)];
}

void NoiseGatherer::Add(const std::vector<float>& image, const std::vector<float>& grey, int width,
                        int height, double share) {
  const double scale = std::sqrt(share / 6);  // 1 + 4 + 1
  for (int y = 0; y < height; ++y) {
    const float* row = &image[static_cast<size_t>(y) * width];
    const float* level = &grey[static_cast<size_t>(y) * width];
    for (int x = 1; x + 1 < width; x += 2) {
      const float least = std::min({level[x - 1], level[x], level[x + 1]});
      const float most = std::max({level[x - 1], level[x], level[x + 1]});
      if (least < 1 || most > kWhite - 1) continue;
      const double difference = std::abs(row[x - 1] - 2.0 * row[x] + row[x + 1]) * scale;
      const int step = std::min(static_cast<int>(difference / kPixelRules.difference_step_grey),
                                kPixelRules.difference_steps - 1);
      const int bin = std::clamp(static_cast<int>(level[x] * kPixelRules.level_bins / kGreyLevels), 0,
                                 kPixelRules.level_bins - 1);
      const size_t at = static_cast<size_t>(bin) * kPixelRules.difference_steps + step;
      counts_[at] += 1;
      squares_[at] += difference * difference;
    }
  }
}

void NoiseGatherer::Add(const NoiseGatherer& other) {
  for (size_t i = 0; i < counts_.size(); ++i) {
    counts_[i] += other.counts_[i];
    squares_[i] += other.squares_[i];
  }
}

double NoiseGatherer::count() const {
  double sum = 0;
  for (const double count : counts_) sum += count;
  return sum;
}

std::vector<LevelScatter> NoiseGatherer::Levels() const {
  std::vector<LevelScatter> levels;
  const double bin_grey = kGreyLevels / kPixelRules.level_bins;
  for (int bin = 0; bin < kPixelRules.level_bins; ++bin) {
    const size_t at = static_cast<size_t>(bin) * kPixelRules.difference_steps;
    const double count =
        std::accumulate(&counts_[at], &counts_[at] + kPixelRules.difference_steps.value(), 0.0);
    if (count < kPixelRules.min_count) continue;
    levels.push_back({(bin + 0.5) * bin_grey,
                      std::max(TrimmedVariance(&counts_[at], &squares_[at], kPixelRules.difference_steps),
                               kRoundingVariance),
                      count});
  }
  return Unclipped(levels, bin_grey);
}

PixelNoise NoiseGatherer::Estimate() const {
  // variance = sigma^2 + gain * grey over the levels, each weighed by count / variance^2.
  std::vector<double> grey, variance, weight;
  for (const LevelScatter& level : Levels()) {
    grey.push_back(level.grey);
    variance.push_back(level.variance);
    weight.push_back(level.count / (level.variance * level.variance));
  }
  if (grey.empty()) return {std::sqrt(kRoundingVariance), 0, 0, 0};
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (size_t i = 0; i < grey.size(); ++i) {
    n += weight[i], sx += weight[i] * grey[i], sy += weight[i] * variance[i];
    sxx += weight[i] * grey[i] * grey[i], sxy += weight[i] * grey[i] * variance[i];
  }
  const double determinant = n * sxx - sx * sx;
  double gain = grey.size() > 1 && determinant > 0 ? (n * sxy - sx * sy) / determinant : 0;
  double square = (sy - gain * sx) / n;
  if (gain < 0) gain = 0, square = sy / n;
  if (square < kRoundingVariance) {
    square = kRoundingVariance;
    gain = std::max((sxy - square * sx) / sxx, 0.0);
  }
  // A bin's variance is known to its share sqrt(2 / (trimmed_efficiency * count)).
  const double variance_scale = 2 / kPixelRules.trimmed_efficiency;
  PixelNoise noise;
  noise.sigma_grey = std::sqrt(square);
  noise.gain = gain;
  if (grey.size() > 1 && determinant > 0) {
    noise.sigma_error = std::sqrt(variance_scale * sxx / determinant) / (2 * noise.sigma_grey);
    noise.gain_error = std::sqrt(variance_scale * n / determinant);
  } else {
    noise.sigma_error = std::sqrt(variance_scale / n) / (2 * noise.sigma_grey);
  }
  return noise;
}

}  // namespace touchstone::diagnosis::images
