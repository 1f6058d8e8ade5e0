#include "server/image/normalize_parting.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

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
    for (size_t k = 0; k < relative_.values.size(); ++k) {
      const auto mean = [&](const std::vector<Plane>& planes) {
        float sum = 0;
        for (const Plane& plane : planes) sum += plane.values[k];
        return sum / static_cast<float>(planes.size());
      };
      const float ground = mean(picture.ground), grey = mean(smooth);
      relative_.values[k] = std::log((grey + floor) / (ground + floor));
      float tolerance = (3.2f * noise + 0.5f) / (ground + floor) + 0.02f;
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
    return best_.inside.empty() ? best_ : Filled(best_);
  }

 private:
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
    if (score <= best_score_ || !LeavesAShadow(region)) return;
    best_score_ = score;
    best_ = std::move(region);
  }

  Plane relative_, slope_, tint_;
  Region is_ground_, is_tinted_, best_;
  double different_ = 0, best_score_ = 0;
  float mode_width_ = 0;
};

}  // namespace

Region PartFromGround(const GroundedPicture& picture) {
  return LevelSearch(picture).Best();
}

}  // namespace touchstone::image
