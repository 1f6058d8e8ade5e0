#include "server/image/normalize/normalize_parting.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "server/image/normalize/normalize_shadow.h"

namespace touchstone::image {
namespace {

constexpr double kMinObjectShare = 0.001, kMaxObjectShare = 0.9;  // of the picture
constexpr double kMaxRimShare =
    0.5;  // of the picture's rim: an object that takes more of it hides the ground
constexpr float kMinSteepness = 0.02f;  // of an outline, per pixel: fainter is noise or light
constexpr float kSmoothPx = 0.6f;
constexpr double kMaxEnclosedShare = 0.08;  // of the object's pixels
constexpr double kMinShadowShare = 0.6;     // of a shadow's pixels, in its umbra
constexpr size_t kMinUmbraPixels = 30;
// JPEG leaves waves beside an edge, within its block of 8 x 8 pixels: at most this share of the edge's height. On a black
// ground, where nothing else is, they would pass for object.
constexpr float kRinging = 0.05f;
constexpr int kRingingPx = 7;
constexpr float kBlackGround = 10;  // grey levels
// Half of a ground that is half of the picture: within 0.674 standard deviations of it lie 50 %.
constexpr double kGroundQuantile = 0.25;
constexpr float kGroundDeviations = 0.674f, kMaxTexture = 0.15f;
// What is seen again as shapes, chosen on the pictures of normalize_test.
constexpr double kMinBrightShare = 0.6;     // of the pixels above the ground's grey: a bright object
constexpr int kClosedPx = 3;                // half the width of the band between two sides
constexpr double kMinDarkSideShare = 0.03;  // of the object's pixels
constexpr int kMinJunctions = 3;            // pixels
constexpr double kMaxShadingShare = 0.5;    // of the outline's steepness: beyond it is an edge
constexpr double kMinCornerBend = 0.12,
                 kMinCornerRatio = 0.8;  // of a bright side's outline: it ends at a dark side
constexpr double kMaxSmoothBend = 0.065,
                 kMaxSmoothRatio = 0.7;   // of an object's outline that runs on beside its shadow
constexpr double kMinShadowEdge = 0.16;   // slope per pixel between object and shadow
constexpr double kMinShadowSize = 0.02;   // of object and shadow together
constexpr double kMinShadowScore = 0.7;   // of the best: below it the outline is another one
constexpr float kDarkestShadow = -1.15f;  // relative grey: a shadow that takes 68 % of the light
constexpr float kShadowTint =
    0.06f;  // how far a shadow's colour may lie from the ground's: light from elsewhere

// The largest value within `reach` pixels along rows and columns.
Plane LargestAround(const Plane& plane, int reach) {
  Plane rows(plane.width, plane.height), around(plane.width, plane.height);
  for (int y = 0; y < plane.height; ++y)
    for (int x = 0; x < plane.width; ++x) {
      float most = plane.at(x, y);
      for (int k = std::max(x - reach, 0); k <= std::min(x + reach, plane.width - 1); ++k)
        most = std::max(most, plane.at(k, y));
      rows.at(x, y) = most;
    }
  for (int y = 0; y < plane.height; ++y)
    for (int x = 0; x < plane.width; ++x) {
      float most = rows.at(x, y);
      for (int k = std::max(y - reach, 0); k <= std::min(y + reach, plane.height - 1); ++k)
        most = std::max(most, rows.at(x, k));
      around.at(x, y) = most;
    }
  return around;
}

Plane SlopeOf(const Plane& plane) {
  Plane slope(plane.width, plane.height);
  for (int y = 0; y < plane.height; ++y)
    for (int x = 0; x < plane.width; ++x) {
      const float across = plane.at(std::min(x + 1, plane.width - 1), y) - plane.at(std::max(x - 1, 0), y);
      const float down = plane.at(x, std::min(y + 1, plane.height - 1)) - plane.at(x, std::max(y - 1, 0));
      slope.at(x, y) = 0.5f * std::sqrt(across * across + down * down);
    }
  return slope;
}

// How far relative grey departs from 0 on a ground with texture, by the half of the picture that departs the least: three
// standard deviations.
float TextureOf(const Plane& relative) {
  std::vector<float> sizes;
  for (const float value : relative.values) sizes.push_back(std::abs(value));
  const auto middle =
      sizes.begin() + static_cast<std::ptrdiff_t>(kGroundQuantile * static_cast<double>(sizes.size()));
  std::nth_element(sizes.begin(), middle, sizes.end());
  return std::min(3 * *middle / kGroundDeviations, kMaxTexture);
}

class LevelSearch {
 public:
  explicit LevelSearch(const GroundedPicture& picture)
      : relative_(picture.width(), picture.height()),
        tint_(picture.width(), picture.height()),
        is_ground_(picture.width(), picture.height()),
        is_tinted_(picture.width(), picture.height()) {
    // Grey levels near black say little: below the floor the logarithm becomes flat.
    const float floor = std::max(8.0f, 4 * picture.noise), noise = kCalmNoise * picture.noise;
    std::vector<Plane> smooth;
    for (const Plane& calm : picture.calm) smooth.push_back(Blurred(calm, kSmoothPx));
    const Plane brightest = LargestAround(smooth[0], kRingingPx);
    const auto mean = [](const std::vector<Plane>& planes, size_t k) {
      float sum = 0;
      for (const Plane& plane : planes) sum += plane.values[k];
      return sum / static_cast<float>(planes.size());
    };
    for (size_t k = 0; k < relative_.values.size(); ++k)
      relative_.values[k] = std::log((mean(smooth, k) + floor) / (mean(picture.ground, k) + floor));
    const float texture = TextureOf(relative_);
    for (size_t k = 0; k < relative_.values.size(); ++k) {
      const float ground = mean(picture.ground, k), grey = mean(smooth, k);
      float tolerance = std::max((3.2f * noise + 0.5f) / (ground + floor) + 0.02f, texture);
      if (ground < kBlackGround)
        tolerance = std::max(tolerance, std::log1p(kRinging * std::max(brightest.values[k] - ground, 0.0f) /
                                                   (ground + floor)));
      tint_.values[k] = picture.channels() == 1 ? 0 : TintAt(smooth, picture.ground, k, floor);
      is_tinted_.inside[k] = tint_.values[k] > (3.2f * noise + 1.2f) / (grey + floor) + kShadowTint;
      is_ground_.inside[k] = !is_tinted_.inside[k] && std::abs(relative_.values[k]) < tolerance;
      if (!is_ground_.inside[k]) different_ += DifferenceAt(k);
      mode_width_ += tolerance;
    }
    mode_width_ = 0.03f + 0.5f * mode_width_ / static_cast<float>(relative_.values.size());
    slope_ = SlopeOf(relative_);
    if (picture.channels() == 1) return;
    const Plane tint_slope = SlopeOf(tint_);
    for (size_t k = 0; k < slope_.values.size(); ++k)
      slope_.values[k] = std::hypot(slope_.values[k], tint_slope.values[k]);
  }

  Region Best() {
    static constexpr float kLevels[] = {0.0f, 0.08f, 0.12f, 0.17f, 0.23f, 0.3f, 0.38f, 0.47f, 0.57f, 0.68f,
                                        0.8f, 0.95f, 1.1f,  1.3f,  1.5f,  1.8f, 2.1f,  2.5f,  1e9f};
    for (const float level : kLevels) Try(level);
    return best_.inside.empty() ? best_ : Filled(Reconsidered(best_));
  }

 private:
  struct Candidate {
    Region region;
    double score = 0;
  };

  // How far the colour lies from the ground's, whatever the light: the part of the pixel that is across the ground's
  // colour, as a share of the whole.
  static float TintAt(const std::vector<Plane>& smooth, const std::vector<Plane>& ground, size_t k,
                      float floor) {
    float along = 0, ground_squares = 0, squares = 0;
    for (size_t c = 0; c < smooth.size(); ++c) {
      const float grey = smooth[c].values[k], lit = ground[c].values[k];
      along += grey * lit, ground_squares += lit * lit, squares += grey * grey;
    }
    const float across =
        ground_squares < 1 ? 0 : std::sqrt(std::max(0.0f, squares - along * along / ground_squares));
    const float channels = std::sqrt(static_cast<float>(smooth.size()));
    return across / (std::sqrt(squares) + channels * floor);
  }

  float DifferenceAt(size_t k) const { return std::abs(relative_.values[k]) + tint_.values[k]; }

  bool MayBeShadowAt(size_t k) const {
    return !is_ground_.inside[k] && !is_tinted_.inside[k] && relative_.values[k] < 0;
  }

  // Ground that object and shadow enclose lies in the shadow too: what is as bright as lit ground there is the object.
  Region Filled(const Region& object) const {
    Region taken = object;
    for (size_t k = 0; k < taken.inside.size(); ++k)
      if (MayBeShadowAt(k)) taken.inside[k] = 1;
    return WithSmallHoles(object, taken, kMaxEnclosedShare);
  }

  // What level and steepness decide is seen again as shapes: a bright object keeps its dark side, a dark one loses the shadow
  // that is darker than half the ground.
  Region Reconsidered(const Region& best) const {
    return IsBright(best) ? WithDarkSide(best) : WithoutShadow(best);
  }

  bool IsBright(const Region& region) const {
    size_t bright = 0;
    for (size_t k = 0; k < region.inside.size(); ++k)
      bright += region.inside[k] != 0 && relative_.values[k] > 0;
    return static_cast<double>(bright) > kMinBrightShare * static_cast<double>(region.Count());
  }

  // Between a bright side and a dark one the grey is the ground's: the widest region is closed over it.
  Region WithDarkSide(const Region& best) const {
    const Region wide = Closed(candidates_.front().region, kClosedPx);
    const Beside beside = LookBeside(best, wide, slope_);
    if (static_cast<double>(beside.pixels) < kMinDarkSideShare * static_cast<double>(best.Count()) ||
        beside.junctions < kMinJunctions)
      return best;
    // Against its shadow an object has an edge; its own shading may be gradual, or the outline goes on along a face.
    const bool gradual = beside.border_slope < kMaxShadingShare * OutlineSteepness(best, slope_);
    const bool goes_on =
        beside.part_bend > kMinCornerBend && beside.part_bend > kMinCornerRatio * beside.whole_bend;
    return gradual || goes_on ? wide : best;
  }

  Region WithoutShadow(const Region& best) const {
    const Candidate* chosen = nullptr;
    for (const Candidate& candidate : candidates_) {
      const auto rest = static_cast<double>(best.Count()) - static_cast<double>(candidate.region.Count());
      if (rest < kMinShadowSize * static_cast<double>(best.Count()) ||
          candidate.score < kMinShadowScore * best_score_ ||
          (chosen != nullptr && candidate.score <= chosen->score) ||
          MedianBetween(candidate.region, best) < kDarkestShadow)
        continue;
      const Beside beside = LookBeside(candidate.region, best, slope_);
      if (beside.junctions >= kMinJunctions && beside.border_slope > kMinShadowEdge &&
          beside.part_bend < kMaxSmoothBend && beside.part_bend < kMaxSmoothRatio * beside.whole_bend)
        chosen = &candidate;
    }
    return chosen == nullptr ? best : chosen->region;
  }

  // Median relative grey of what `whole` has and `part` has not.
  float MedianBetween(const Region& part, const Region& whole) const {
    std::vector<float> rest;
    for (size_t k = 0; k < part.inside.size(); ++k)
      if (whole.inside[k] != 0 && part.inside[k] == 0) rest.push_back(relative_.values[k]);
    if (rest.empty()) return 0;
    const auto middle = rest.begin() + static_cast<std::ptrdiff_t>(rest.size() / 2);
    std::nth_element(rest.begin(), middle, rest.end());
    return *middle;
  }

  // What `object` leaves out may all be its shadow, or there is too little of it to tell: a shadow is darker than the
  // ground, and everywhere by the same factor but for its rim.
  bool LeavesAShadow(const Region& object) const {
    std::vector<float> values;
    const int width = object.width, height = object.height;
    const auto left_out = [&](int x, int y) {
      return !object.at(x, y) && MayBeShadowAt(static_cast<size_t>(y) * width + x);
    };
    for (int y = 2; y + 2 < height; ++y)
      for (int x = 2; x + 2 < width; ++x)
        if (left_out(x, y) && left_out(x - 2, y) && left_out(x + 2, y) && left_out(x, y - 2) &&
            left_out(x, y + 2))
          values.push_back(relative_.at(x, y));
    if (values.size() < kMinUmbraPixels) return true;
    std::sort(values.begin(), values.end());
    size_t most = 0;
    for (size_t first = 0, last = 0; first < values.size(); ++first) {
      while (last < values.size() && values[last] <= values[first] + 2 * mode_width_) ++last;
      most = std::max(most, last - first);
    }
    return static_cast<double>(most) >= kMinShadowShare * static_cast<double>(values.size());
  }

  // Everything that is brighter than the ground, of another colour, or darker than a shadow of this level.
  void Try(float level) {
    Region raw(relative_.width, relative_.height);
    for (size_t k = 0; k < raw.inside.size(); ++k)
      raw.inside[k] = !is_ground_.inside[k] &&
                      (relative_.values[k] > 0 || relative_.values[k] < -level || is_tinted_.inside[k]);
    Region region = Cleaned(raw, is_ground_);
    const double share = static_cast<double>(region.Count()) / static_cast<double>(region.inside.size());
    if (share < kMinObjectShare || share > kMaxObjectShare || RimShare(region) > kMaxRimShare) return;
    const float steepness = OutlineSteepness(region, slope_);
    if (steepness < kMinSteepness) return;
    double explained = 0;
    for (size_t k = 0; k < region.inside.size(); ++k)
      if (region.inside[k] && !is_ground_.inside[k]) explained += DifferenceAt(k);
    const double score = steepness * std::sqrt(explained / std::max(different_, 1e-9));
    candidates_.push_back({region, score});
    // What is brighter than the ground has its dark side seen again (Reconsidered), and no shadow of it.
    if (score <= best_score_ || !(LeavesAShadow(region) || IsBright(region))) return;
    best_score_ = score;
    best_ = std::move(region);
  }

  Plane relative_, slope_, tint_;
  Region is_ground_, is_tinted_, best_;
  std::vector<Candidate> candidates_;  // of all levels, the widest first
  double different_ = 0, best_score_ = 0;
  float mode_width_ = 0;
};

}  // namespace

Region PartFromGround(const GroundedPicture& picture) {
  return LevelSearch(picture).Best();
}

}  // namespace touchstone::image
