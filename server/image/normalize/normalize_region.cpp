#include "server/image/normalize/normalize_region.h"

#include <algorithm>
#include <cmath>

namespace touchstone::image {
namespace {

constexpr double kMinComponentShare = 1.0 / 12;
constexpr double kMinHoleGroundShare = 0.7;
constexpr size_t kMinHolePixels = 9;

// The majority among the nine pixels around.
Region Majority(const Region& region) {
  Region result(region.width, region.height);
  for (int y = 0; y < region.height; ++y)
    for (int x = 0; x < region.width; ++x) {
      int count = 0;
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx)
          count +=
              region.at(std::clamp(x + dx, 0, region.width - 1), std::clamp(y + dy, 0, region.height - 1));
      result.at(x, y) = count >= 5;
    }
  return result;
}

// Pixels of equal value that hang together by their edges, as lists of indices; only those of `value`.
std::vector<std::vector<int>> ComponentsOf(const Region& region, uint8_t value) {
  std::vector<std::vector<int>> components;
  std::vector<uint8_t> seen(region.inside.size());
  const int width = region.width, size = static_cast<int>(region.inside.size());
  for (int start = 0; start < size; ++start) {
    if (seen[start] || region.inside[start] != value) continue;
    std::vector<int>& component = components.emplace_back();
    component.push_back(start);
    seen[start] = 1;
    for (size_t k = 0; k < component.size(); ++k) {
      const int at = component[k], x = at % width;
      const auto visit = [&](int next, bool there) {
        if (!there || seen[next] || region.inside[next] != value) return;
        seen[next] = 1;
        component.push_back(next);
      };
      visit(at - 1, x > 0);
      visit(at + 1, x + 1 < width);
      visit(at - width, at >= width);
      visit(at + width, at + width < size);
    }
  }
  return components;
}

bool TouchesRim(const Region& region, const std::vector<int>& component) {
  return std::any_of(component.begin(), component.end(), [&](int at) {
    const int x = at % region.width, y = at / region.width;
    return x == 0 || y == 0 || x + 1 == region.width || y + 1 == region.height;
  });
}

// Sums over the square of `reach` around each pixel, by an integral image.
class BoxSums {
 public:
  BoxSums(int width, int height)
      : width_(width), height_(height), sums_(static_cast<size_t>(width + 1) * (height + 1)) {}
  template <typename Value>
  void Fill(const Value& value) {
    for (int y = 0; y < height_; ++y) {
      double row = 0;
      for (int x = 0; x < width_; ++x) {
        row += value(x, y);
        At(x + 1, y + 1) = At(x + 1, y) + row;
      }
    }
  }
  double Around(int x, int y, int reach) {
    const int left = std::max(x - reach, 0), right = std::min(x + reach + 1, width_);
    const int top = std::max(y - reach, 0), bottom = std::min(y + reach + 1, height_);
    return At(right, bottom) - At(left, bottom) - At(right, top) + At(left, top);
  }

 private:
  double& At(int x, int y) { return sums_[static_cast<size_t>(y) * (width_ + 1) + x]; }
  int width_, height_;
  std::vector<double> sums_;
};

// Steps to the outline, in city blocks, up to `most`: 0 for pixels at it.
std::vector<int> StepsToOutline(const Region& region, int most) {
  std::vector<int> steps(region.inside.size(), most);
  const int width = region.width, height = region.height;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const uint8_t own = region.at(x, y);
      if ((x > 0 && region.at(x - 1, y) != own) || (x + 1 < width && region.at(x + 1, y) != own) ||
          (y > 0 && region.at(x, y - 1) != own) || (y + 1 < height && region.at(x, y + 1) != own))
        steps[static_cast<size_t>(y) * width + x] = 0;
    }
  for (int round = 0; round + 1 < most; ++round)
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        int& own = steps[static_cast<size_t>(y) * width + x];
        const auto closer = [&](int dx, int dy) {
          const int nx = x + dx, ny = y + dy;
          return nx >= 0 && ny >= 0 && nx < width && ny < height &&
                 steps[static_cast<size_t>(ny) * width + nx] == round;
        };
        if (own > round + 1 && (closer(-1, 0) || closer(1, 0) || closer(0, -1) || closer(0, 1)))
          own = round + 1;
      }
  return steps;
}

}  // namespace

size_t Region::Count() const {
  return static_cast<size_t>(std::count(inside.begin(), inside.end(), uint8_t{1}));
}

Region Cleaned(const Region& raw, const Region& is_ground) {
  Region region = Majority(raw);
  const std::vector<std::vector<int>> parts = ComponentsOf(region, 1);
  size_t largest = 0;
  for (const std::vector<int>& part : parts) largest = std::max(largest, part.size());
  for (const std::vector<int>& part : parts)
    if (static_cast<double>(part.size()) < kMinComponentShare * static_cast<double>(largest))
      for (const int at : part) region.inside[at] = 0;
  for (const std::vector<int>& hole : ComponentsOf(region, 0)) {
    if (TouchesRim(region, hole)) continue;
    const auto ground =
        std::count_if(hole.begin(), hole.end(), [&](int at) { return is_ground.inside[at] != 0; });
    const bool seen_through =
        hole.size() >= kMinHolePixels &&
        static_cast<double>(ground) > kMinHoleGroundShare * static_cast<double>(hole.size());
    if (!seen_through)
      for (const int at : hole) region.inside[at] = 1;
  }
  return region;
}

double RimShare(const Region& region) {
  int inside = 0;
  for (int x = 0; x < region.width; ++x) inside += region.at(x, 0) + region.at(x, region.height - 1);
  for (int y = 1; y + 1 < region.height; ++y) inside += region.at(0, y) + region.at(region.width - 1, y);
  return static_cast<double>(inside) / (2 * (region.width + region.height) - 4);
}

Region WithSmallHoles(const Region& region, const Region& taken, double max_share) {
  Region result = region;
  const double most = max_share * static_cast<double>(region.Count());
  for (const std::vector<int>& hole : ComponentsOf(taken, 0)) {
    if (static_cast<double>(hole.size()) > most || TouchesRim(taken, hole)) continue;
    const bool beside = std::any_of(hole.begin(), hole.end(), [&](int at) {
      const int x = at % region.width, y = at / region.width;
      return region.Has(x - 1, y) || region.Has(x + 1, y) || region.Has(x, y - 1) || region.Has(x, y + 1);
    });
    if (beside)
      for (const int at : hole) result.inside[at] = 1;
  }
  return result;
}

float OutlineSteepness(const Region& region, const Plane& slope) {
  double sum = 0;
  int64_t count = 0;
  for (int y = 0; y < region.height; ++y)
    for (int x = 0; x < region.width; ++x) {
      if (region.at(x, y) == 0) continue;
      for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
        if (region.Has(x + dx, y + dy)) continue;
        ++count;
        if (x + dx < 0 || y + dy < 0 || x + dx >= region.width || y + dy >= region.height) continue;
        sum += 0.5 * (slope.at(x, y) + slope.at(x + dx, y + dy));
      }
    }
  return count == 0 ? 0 : static_cast<float>(sum / static_cast<double>(count));
}

Region Refined(const Region& region, const std::vector<Plane>& channels) {
  constexpr int kBand = 2, kReach = 6;
  const std::vector<int> steps = StepsToOutline(region, kBand + 1);
  const int width = region.width, height = region.height;
  const auto deep = [&](int x, int y, uint8_t side) {
    const size_t at = static_cast<size_t>(y) * width + x;
    return region.inside[at] == side && steps[at] >= kBand;
  };
  std::vector<BoxSums> sums(2 * channels.size(), {width, height}), counts(2, {width, height});
  for (const uint8_t side : {uint8_t{0}, uint8_t{1}}) {
    counts[side].Fill([&](int x, int y) { return deep(x, y, side) ? 1.0 : 0.0; });
    for (size_t c = 0; c < channels.size(); ++c)
      sums[2 * c + side].Fill(
          [&](int x, int y) { return deep(x, y, side) ? static_cast<double>(channels[c].at(x, y)) : 0.0; });
  }
  Region result = region;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      if (steps[static_cast<size_t>(y) * width + x] >= kBand) continue;
      const double outside = counts[0].Around(x, y, kReach), inside = counts[1].Around(x, y, kReach);
      if (outside < 4 || inside < 4) continue;
      double along = 0, squares = 0;
      for (size_t c = 0; c < channels.size(); ++c) {
        const double ground = sums[2 * c].Around(x, y, kReach) / outside,
                     object = sums[2 * c + 1].Around(x, y, kReach) / inside;
        along += (channels[c].at(x, y) - ground) * (object - ground);
        squares += (object - ground) * (object - ground);
      }
      if (squares < 16) continue;
      result.at(x, y) = along > 0.5 * squares;
    }
  return Majority(result);
}

}  // namespace touchstone::image
