#include "server/diagnosis/images/rows/stuck_pixels.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "server/diagnosis/images/rows/rules.h"

namespace touchstone::diagnosis::images {
namespace {

class Finder {
 public:
  Finder(const Photographs& p, const std::vector<image::Photo>& expected) : p_(p), expected_(expected) {}

  StuckPixels Find() const {
    StuckPixels found;
    for (int y = 0; y < p_.height(); ++y)
      for (int x = 0; x < p_.width(); ++x) {
        if (!IsSame(At(x, y)) || !StandsOut(x, y)) continue;
        found.places.emplace_back(x, y);
        for (int k = 0; k < p_.size(); ++k)
          found.excess += std::pow(Residual(k, x, y), 2) - p_.record->Variance(expected_[k].grey[At(x, y)]);
      }
    return found;
  }

 private:
  size_t At(int x, int y) const { return static_cast<size_t>(y) * p_.width() + x; }
  double Residual(int k, int x, int y) const {
    return static_cast<double>(p_.measured_grey[k][At(x, y)]) - expected_[k].grey[At(x, y)];
  }

  bool IsSame(size_t at) const {
    float least = INFINITY, largest = -INFINITY;
    for (int k = 0; k < p_.size(); ++k) {
      least = std::min(least, p_.measured_grey[k][at]);
      largest = std::max(largest, p_.measured_grey[k][at]);
    }
    return largest - least <=
           kPhotoRowRules.same_sigmas * std::sqrt(p_.record->Variance(0.5 * (least + largest)));
  }

  double MedianAround(int k, int x, int y) const {
    std::array<double, 8> around{};
    size_t count = 0;
    for (int j = std::max(y - 1, 0); j <= std::min(y + 1, p_.height() - 1); ++j)
      for (int i = std::max(x - 1, 0); i <= std::min(x + 1, p_.width() - 1); ++i)
        if (i != x || j != y) around[count++] = Residual(k, i, j);
    const auto middle = around.begin() + static_cast<long>(count / 2);
    std::nth_element(around.begin(), middle, around.begin() + static_cast<long>(count));
    return *middle;
  }

  bool StandsOut(int x, int y) const {
    std::vector<char> apart(p_.poses, 0);
    for (int k = 0; k < p_.size(); ++k) {
      const double far =
          kPhotoRowRules.apart_sigmas * std::sqrt(p_.record->Variance(expected_[k].grey[At(x, y)]));
      const double residual = Residual(k, x, y);
      if (std::abs(residual) > far && std::abs(residual - MedianAround(k, x, y)) > far) apart[p_.pose[k]] = 1;
    }
    return std::count(apart.begin(), apart.end(), 1) >= kPhotoRowRules.min_apart_poses;
  }

  const Photographs& p_;
  const std::vector<image::Photo>& expected_;
};

}  // namespace

StuckPixels FindStuckPixels(const Photographs& photographs, const std::vector<image::Photo>& expected) {
  return Finder(photographs, expected).Find();
}

std::string PlacesInWords(const StuckPixels& stuck) {
  std::string words;
  for (size_t n = 0; n < std::min(stuck.places.size(), kPhotoRowRules.places_shown.value()); ++n)
    absl::StrAppend(&words, n == 0 ? "" : ", ", "column ", stuck.places[n].first, " row ",
                    stuck.places[n].second);
  return stuck.places.size() > kPhotoRowRules.places_shown ? absl::StrCat(words, ", ...") : words;
}

}  // namespace touchstone::diagnosis::images
