// How much single pixels scatter, as images themselves show it: from what neighbouring pixels differ by.
#pragma once

#include <cstddef>
#include <vector>

#include "server/diagnosis/images/pixels/rules.h"

namespace touchstone::diagnosis::images {

// The scatter of single pixels: variance sigma^2 + gain * grey, rounding to 8 bits included.
struct PixelNoise {
  double sigma_grey = 0, gain = 0;
  double sigma_error = 0, gain_error = 0;  // standard errors, where it was estimated

  double Variance(double grey) const { return sigma_grey * sigma_grey + gain * grey; }
};

// What a clipped 8-bit pixel of this grey level records: its mean and variance.
struct RecordedPixel {
  double mean_grey = 0, variance = 0;
  double clipped = 0;  // share of its records
};
RecordedPixel Record(double grey, const PixelNoise& noise);

// The same from a table, for many pixels.
class RecordTable {
 public:
  explicit RecordTable(const PixelNoise& noise);
  float Mean(float grey) const;
  // The same of many pixels, in place.
  void ToMeans(float* grey, size_t count) const;
  void ToMeans(std::vector<float>* grey) const { ToMeans(grey->data(), grey->size()); }
  // Of a pixel that records `mean` on average.
  double Variance(double mean) const { return At(variance_, mean); }
  double Clipped(double mean) const { return At(clipped_, mean); }

 private:
  double At(const std::vector<float>& values, double mean) const;
  PixelNoise noise_;
  std::vector<float> mean_;  // by grey level
  float first_kept_grey_ = 1,
        last_kept_grey_ = 0;               // between them a record's mean is the grey level; none: 1 and 0
  std::vector<float> variance_, clipped_;  // by what is recorded on average
};

// The scatter at one grey level.
struct LevelScatter {
  double grey = 0, variance = 0;
  double count = 0;  // of differences
};

// Gathers second differences of images along their rows, by grey level.
class NoiseGatherer {
 public:
  // `image`: what scatters (a picture, a residual, a difference of two repeats); `grey`: the grey levels of the same
  // pixels, which choose the bin and tell clipped pixels. `share`: of the image's variance that one picture's noise has
  // (a difference of two repeats: 0.5). Width x height each.
  void Add(const std::vector<float>& image, const std::vector<float>& grey, int width, int height,
           double share);
  void Add(const NoiseGatherer& other);

  // The noise of the smoother four fifths of the pixels: edges and texture take no part, where they are fewer.
  PixelNoise Estimate() const;
  // By grey level, where enough differences are; of levels that clipping hardly touches, or of the one that it touches least.
  std::vector<LevelScatter> Levels() const;
  double count() const;

 private:
  std::vector<double> counts_ =
      std::vector<double>(static_cast<size_t>(kPixelRules.level_bins) * kPixelRules.difference_steps, 0.0);
  std::vector<double> squares_ =
      std::vector<double>(static_cast<size_t>(kPixelRules.level_bins) * kPixelRules.difference_steps, 0.0);
};

}  // namespace touchstone::diagnosis::images
