#include "server/diagnosis/images/rows/photo_uneven_noise.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "server/diagnosis/engine/competition/rules.h"
#include "server/diagnosis/engine/competition/uneven_parts.h"
#include "server/diagnosis/images/pixels/photo_cells.h"
#include "server/diagnosis/images/pixels/rules.h"
#include "server/diagnosis/images/rows/rules.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr int kQuarters = 4;

struct NoisyPart {
  std::string name;
  double degrees = 0;  // of freedom of its variance
  double ratio = 0;    // of its variance over that of one noise for all
};

struct NoisyPartition {
  std::string covariate, by;
  std::vector<NoisyPart> parts;
};

// Residuals, and expected grey levels, 0 as clipped ones at contours. A measured level would choose a pixel by its noise.
struct AssessedPicture {
  std::vector<float> residual, level;
};

NoisyPart PartOf(std::string name, const NoiseGatherer& gathered, const PixelNoise& noise) {
  NoisyPart part{std::move(name)};
  for (const LevelScatter& level : gathered.Levels()) {
    const double degrees = kPixelRules.trimmed_efficiency * level.count;
    part.degrees += degrees;
    part.ratio += degrees * level.variance / noise.Variance(level.grey);
  }
  part.ratio /= std::max(part.degrees, 1.0);
  return part;
}

std::optional<engine::CovariateTest> TestParts(NoisyPartition* partition) {
  std::vector<NoisyPart>& parts = partition->parts;
  parts.erase(
      std::remove_if(parts.begin(), parts.end(),
                     [](const NoisyPart& part) { return part.degrees < kPhotoRowRules.min_part_dof; }),
      parts.end());
  if (parts.size() < 2) return std::nullopt;
  double degrees = 0, mean = 0;
  for (const NoisyPart& part : parts) degrees += part.degrees, mean += part.degrees * part.ratio;
  mean /= degrees;
  double gain_nats = 0;
  for (const NoisyPart& part : parts)
    gain_nats += 0.5 * part.degrees * (part.ratio / mean - 1 - std::log(part.ratio / mean));
  std::sort(parts.begin(), parts.end(), [](const auto& a, const auto& b) { return a.ratio < b.ratio; });
  return engine::TestUneven(partition->covariate, gain_nats, static_cast<double>(parts.size()), degrees,
                            std::sqrt(parts.front().ratio), std::sqrt(parts.back().ratio));
}

class UnevenNoiseSearch {
 public:
  UnevenNoiseSearch(const Photographs& photographs, const std::vector<image::Photo>& expected,
                    ThreadPool* pool)
      : p_(photographs), expected_(expected), pool_(pool), assessed_(p_.size()), of_picture_(p_.size()) {
    ParallelFor(pool_, p_.size(), 1, [&](int begin, int end) {
      for (int k = begin; k < end; ++k) {
        AssessedPicture& assessed = assessed_[k];
        assessed.residual = p_.measured_grey[k];
        assessed.level = expected_[k].grey;
        const std::vector<float> contours = ContourSquares(expected_[k].grey, p_.width(), p_.height());
        for (size_t i = 0; i < contours.size(); ++i) {
          assessed.residual[i] -= expected_[k].grey[i];
          if (contours[i] > kPhotoRowRules.contour_grey * kPhotoRowRules.contour_grey ||
              p_.record->Clipped(expected_[k].grey[i]) > kPhotoRowRules.max_clipped_share)
            assessed.level[i] = 0;
        }
        of_picture_[k].Add(assessed.residual, assessed.level, p_.width(), p_.height(), 1);
      }
    });
    for (const NoiseGatherer& one : of_picture_) all_.Add(one);
    noise_ = all_.Estimate();
  }

  std::vector<NoisyPartition> All() const {
    std::vector<NoisyPartition> all;
    all.push_back(OfPictures("object", "the object", p_.objects, [&](int k) { return p_.object[k]; }));
    std::vector<std::string> names;
    for (int k = 0; k < p_.size(); ++k)
      names.push_back(absl::StrCat("image ", p_.set->photographs[p_.row[k]].image));
    all.push_back(OfPictures("image", "the picture", names, [](int k) { return k; }));
    all.push_back(OfTime());
    all.push_back(OfGreyLevels());
    const auto quarter = [](int at, int size) { return at * kQuarters / size; };
    all.push_back(
        OfPixels("column", "the column", {"left", "left of the middle", "right of the middle", "right"},
                 [&](int, size_t i) { return quarter(static_cast<int>(i) % p_.width(), p_.width()); }));
    all.push_back(
        OfPixels("row", "the row", {"top", "above the middle", "below the middle", "bottom"},
                 [&](int, size_t i) { return quarter(static_cast<int>(i) / p_.width(), p_.height()); }));
    all.push_back(OfPixels("mask", "whether a pixel sees the object", {"the ground", "the object"},
                           [&](int k, size_t i) { return expected_[k].mask[i] != 0 ? 1 : 0; }));
    return all;
  }

  // In grey levels, of a pixel of medium grey or what the set has.
  double Scale(const NoisyPart& part) const {
    double variance = 0, count = 0;
    for (const LevelScatter& level : all_.Levels())
      variance += level.count * noise_.Variance(level.grey), count += level.count;
    return std::sqrt(part.ratio * variance / std::max(count, 1.0));
  }

 private:
  NoisyPartition OfPictures(std::string covariate, std::string by, const std::vector<std::string>& names,
                            const std::function<int(int)>& part_of) const {
    std::vector<NoiseGatherer> parts(names.size());
    for (int k = 0; k < p_.size(); ++k) parts[part_of(k)].Add(of_picture_[k]);
    NoisyPartition made{std::move(covariate), std::move(by), {}};
    for (size_t j = 0; j < parts.size(); ++j) made.parts.push_back(PartOf(names[j], parts[j], noise_));
    return made;
  }

  NoisyPartition OfTime() const {
    std::vector<int> order(p_.size()), place(p_.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return p_.TimeOf(a) < p_.TimeOf(b); });
    for (int at = 0; at < p_.size(); ++at) place[order[at]] = at * kQuarters / p_.size();
    return OfPictures(p_.set->has_session_time ? "session_time_s" : "image", "the place in the session",
                      {"the first quarter of the session", "the second", "the third", "the last"},
                      [&](int k) { return place[k]; });
  }

  NoisyPartition OfGreyLevels() const {
    NoisyPartition made{"grey", "the grey level", {}};
    const double half_bin_grey = 128.0 / kPixelRules.level_bins;
    for (const LevelScatter& level : all_.Levels()) {
      NoisyPart part{absl::StrFormat("%g to %g", level.grey - half_bin_grey, level.grey + half_bin_grey)};
      part.degrees = kPixelRules.trimmed_efficiency * level.count;
      part.ratio = level.variance / noise_.Variance(level.grey);
      made.parts.push_back(std::move(part));
    }
    return made;
  }

  NoisyPartition OfPixels(std::string covariate, std::string by, const std::vector<std::string>& names,
                          const std::function<int(int, size_t)>& part_of) const {
    const int count = static_cast<int>(names.size());
    std::vector<NoiseGatherer> parts(count);
    ParallelFor(pool_, count, 1, [&](int begin, int end) {
      for (int j = begin; j < end; ++j)
        for (int k = 0; k < p_.size(); ++k) {
          std::vector<float> level = assessed_[k].level;
          for (size_t i = 0; i < level.size(); ++i)
            if (part_of(k, i) != j) level[i] = 0;
          parts[j].Add(assessed_[k].residual, level, p_.width(), p_.height(), 1);
        }
    });
    NoisyPartition made{std::move(covariate), std::move(by), {}};
    for (int j = 0; j < count; ++j) made.parts.push_back(PartOf(names[j], parts[j], noise_));
    return made;
  }

  const Photographs& p_;
  const std::vector<image::Photo>& expected_;
  ThreadPool* pool_;
  std::vector<AssessedPicture> assessed_;
  std::vector<NoiseGatherer> of_picture_;
  NoiseGatherer all_;
  PixelNoise noise_;
};

}  // namespace

std::optional<UnevenNoise> FindUnevenNoise(const Photographs& p, const std::vector<image::Photo>& expected,
                                           ThreadPool* pool) {
  const UnevenNoiseSearch search(p, expected, pool);
  std::vector<NoisyPartition> all = search.All();
  std::vector<std::optional<engine::CovariateTest>> tests;
  size_t best = all.size();
  for (size_t j = 0; j < all.size(); ++j) {
    tests.push_back(TestParts(&all[j]));
    if (tests[j] && (best == all.size() || tests[j]->gain_nats > tests[best]->gain_nats)) best = j;
  }
  if (best == all.size()) return std::nullopt;
  std::vector<std::string> parts, alike;
  const std::vector<NoisyPart>& own = all[best].parts;
  for (size_t j = 0; j < own.size(); ++j)
    if (own.size() <= kPhotoRowRules.parts_shown || j == 0 || j + 1 == own.size())
      parts.push_back(absl::StrFormat("%s %.2g", own[j].name, search.Scale(own[j])));
  for (size_t j = 0; j < all.size(); ++j)
    if (j != best && tests[j] &&
        tests[j]->gain_nats > engine::kCompetitionRules.alike_uneven_share * tests[best]->gain_nats)
      alike.push_back(all[j].by);
  UnevenNoise found;
  found.test = *tests[best];
  found.test.p = std::min(1.0, found.test.p * static_cast<double>(all.size()));
  found.words = absl::StrCat("Pixels scatter by an amount that depends on ", all[best].by,
                             " (grey levels, from the least): ", absl::StrJoin(parts, ", "), ".");
  if (!alike.empty())
    absl::StrAppend(&found.words, " It can be told as well by ", absl::StrJoin(alike, " and "), ".");
  absl::StrAppend(&found.words,
                  " No noise of the catalogue does, and where it is cut at black it looks like light.");
  return found;
}

}  // namespace touchstone::diagnosis::images
