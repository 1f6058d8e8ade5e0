#include "server/diagnosis/checks/photographs/photo_channel_order.h"

#include <absl/strings/str_cat.h>

#include <cmath>

#include "server/diagnosis/checks/photographs/rules.h"

namespace touchstone::diagnosis::checks {
namespace {

// Mean log(red / blue) of what is neither dark nor clipped; NaN: grey, or too little of it.
double Tint(const session::PhotographRow& row) {
  if (row.channels != 3) return NAN;
  double sum = 0;
  int count = 0;
  for (size_t at = 0; at + 2 < row.pixels.size(); at += 3) {
    const int r = row.pixels[at], b = row.pixels[at + 2];
    if (std::min(r, b) < kPhotoCheckRules.dark || std::max(r, b) > kPhotoCheckRules.bright) continue;
    sum += std::log(static_cast<double>(r) / b);
    ++count;
  }
  return count < kPhotoCheckRules.min_pixels ? NAN : sum / count;
}

// Mean size of the tints of one sign; NaN where they are no one colour.
double TintOf(const std::vector<double>& tints, bool red) {
  double sum = 0, squares = 0;
  int count = 0;
  for (const double tint : tints) {
    if (std::isnan(tint) || (tint > 0) != red) continue;
    sum += std::abs(tint), squares += tint * tint, ++count;
  }
  if (count < kPhotoCheckRules.min_pictures_of_order) return NAN;
  const double mean = sum / count, spread = std::sqrt(std::max(0.0, squares / count - mean * mean));
  return mean >= kPhotoCheckRules.min_tint && spread <= kPhotoCheckRules.max_tint_spread * mean ? mean : NAN;
}

}  // namespace

std::optional<CandidateMistake> MixedChannelOrder(const session::ImageSet& set) {
  std::vector<double> tints;
  int reddish = 0, bluish = 0;
  for (const session::PhotographRow& row : set.photographs) {
    tints.push_back(Tint(row));
    reddish += tints.back() > 0, bluish += tints.back() < 0;
  }
  const double red = TintOf(tints, true), blue = TintOf(tints, false);
  // The same colour seen the other way round, not two colours.
  if (std::isnan(red) || std::isnan(blue) || std::max(red, blue) > 1.5 * std::min(red, blue))
    return std::nullopt;
  const bool red_is_wrong = reddish < bluish;
  CandidateMistake mistake;
  mistake.kind = ProblemKind::kChannelOrder;
  mistake.fix.swap_channels = true;
  for (size_t row = 0; row < set.size(); ++row) {
    if (std::isnan(tints[row]) || (tints[row] > 0) != red_is_wrong) continue;
    const uint64_t image = set.photographs[row].image;
    auto& ranges = mistake.fix.images;
    if (!ranges.empty() && ranges.back().second + 1 == image)
      ranges.back().second = image;
    else
      ranges.emplace_back(image, image);
  }
  if (mistake.fix.images.size() > kPhotoCheckRules.max_ranges) return std::nullopt;
  mistake.detail = absl::StrCat(std::min(reddish, bluish), " of ", set.size(), " pictures");
  mistake.words = absl::StrCat(std::min(reddish, bluish), " of the ", set.size(),
                               " pictures have red and blue the other way round than the others (RGB and BGR "
                               "mixed). No error of this report "
                               "depends on it, since grey levels are the mean of the three channels; what is "
                               "trained on the pictures does");
  return mistake;
}

}  // namespace touchstone::diagnosis::checks
