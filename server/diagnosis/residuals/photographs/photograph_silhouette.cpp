#include "server/diagnosis/residuals/photographs/photograph_silhouette.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/diagnosis/residuals/photographs/rules.h"

namespace touchstone::diagnosis::residuals {
namespace {

constexpr float kFar = 1e12f;
constexpr double kSigmaOfMad = 1.4826;

// Lower envelope of parabolas along one line.
void DistancesAlong(std::vector<float>* line, int count) {
  std::vector<float> f(line->begin(), line->begin() + count), edge(count + 1);
  std::vector<int> place(count);
  int last = 0;
  place[0] = 0;
  edge[0] = -std::numeric_limits<float>::infinity();
  edge[1] = std::numeric_limits<float>::infinity();
  for (int q = 1; q < count; ++q) {
    const auto meets = [&](int p) {
      return (static_cast<double>(f[q]) + static_cast<double>(q) * q - f[p] - static_cast<double>(p) * p) /
             (2.0 * (q - p));
    };
    double s = meets(place[last]);
    while (s <= edge[last]) s = meets(place[--last]);
    place[++last] = q;
    edge[last] = static_cast<float>(s);
    edge[last + 1] = std::numeric_limits<float>::infinity();
  }
  int k = 0;
  for (int q = 0; q < count; ++q) {
    while (edge[k + 1] < q) ++k;
    (*line)[q] = static_cast<float>(q - place[k]) * static_cast<float>(q - place[k]) + f[place[k]];
  }
}

double Median(std::vector<float> values) {
  const size_t middle = values.size() / 2;
  std::nth_element(values.begin(), values.begin() + middle, values.end());
  return values[middle];
}

// Drops pieces of less than `min_pixels` connected pixels.
void DropSmallPieces(int width, int height, int min_pixels, std::vector<char>* object) {
  std::vector<char> seen(object->size(), 0);
  std::vector<int> piece;
  for (int start = 0; start < width * height; ++start) {
    if (!(*object)[start] || seen[start]) continue;
    piece.assign(1, start);
    seen[start] = 1;
    for (size_t k = 0; k < piece.size(); ++k) {
      const int x = piece[k] % width, y = piece[k] / width;
      const auto visit = [&](int nx, int ny) {
        if (nx < 0 || ny < 0 || nx >= width || ny >= height) return;
        const int at = ny * width + nx;
        if ((*object)[at] && !seen[at]) seen[at] = 1, piece.push_back(at);
      };
      visit(x - 1, y), visit(x + 1, y), visit(x, y - 1), visit(x, y + 1);
    }
    if (static_cast<int>(piece.size()) < min_pixels)
      for (const int at : piece) (*object)[at] = 0;
  }
}

}  // namespace

std::vector<float> SquaredDistances(const std::vector<char>& set, int width, int height) {
  std::vector<float> distances(set.size());
  for (size_t at = 0; at < set.size(); ++at) distances[at] = set[at] ? 0 : kFar;
  std::vector<float> line(std::max(width, height));
  for (int x = 0; x < width; ++x) {
    for (int y = 0; y < height; ++y) line[y] = distances[static_cast<size_t>(y) * width + x];
    DistancesAlong(&line, height);
    for (int y = 0; y < height; ++y) distances[static_cast<size_t>(y) * width + x] = line[y];
  }
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) line[x] = distances[static_cast<size_t>(y) * width + x];
    DistancesAlong(&line, width);
    for (int x = 0; x < width; ++x) distances[static_cast<size_t>(y) * width + x] = line[x];
  }
  return distances;
}

std::vector<char> OutlineOf(const std::vector<char>& object, int width, int height) {
  std::vector<char> outline(object.size(), 0);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const size_t at = static_cast<size_t>(y) * width + x;
      if (!object[at]) continue;
      // The picture's border is no outline: the object goes on beyond it.
      outline[at] = (x > 0 && !object[at - 1]) || (x + 1 < width && !object[at + 1]) ||
                    (y > 0 && !object[at - width]) || (y + 1 < height && !object[at + width]);
    }
  return outline;
}

Silhouette CompareSilhouettes(const std::vector<float>& measured, const std::vector<float>& expected,
                              const std::vector<uint8_t>& mask, int width, int height) {
  std::vector<char> object(mask.size());
  int object_pixels = 0;
  for (size_t at = 0; at < mask.size(); ++at) object[at] = mask[at] != 0, object_pixels += object[at];
  const Silhouette unknown = {NAN, NAN};
  if (object_pixels == 0) return unknown;
  const std::vector<float> from_object = SquaredDistances(object, width, height);
  std::vector<float> background;
  for (size_t at = 0; at < mask.size(); ++at)
    if (from_object[at] >=
        kPhotographResidualRules.clear_of_object_px * kPhotographResidualRules.clear_of_object_px)
      background.push_back(measured[at]);
  if (background.size() < kPhotographResidualRules.min_background * mask.size()) return unknown;
  const double level = Median(background);
  for (float& grey : background) grey = static_cast<float>(std::abs(grey - level));
  const double stand_out =
      std::max(kPhotographResidualRules.min_stand_out.value(),
               kPhotographResidualRules.stand_out_sigmas * kSigmaOfMad * Median(background));

  std::vector<char> seen(mask.size());
  for (size_t at = 0; at < mask.size(); ++at) seen[at] = std::abs(measured[at] - level) > stand_out;
  DropSmallPieces(width, height,
                  std::max(2, static_cast<int>(kPhotographResidualRules.min_piece * object_pixels)), &seen);
  // Where the object is as bright as the background it is taken as expected, and not counted.
  std::vector<char> counts(mask.size());
  for (size_t at = 0; at < mask.size(); ++at) {
    counts[at] = !object[at] || std::abs(expected[at] - level) > stand_out;
    if (!counts[at]) seen[at] = object[at];
  }
  int both = 0, either = 0;
  for (size_t at = 0; at < mask.size(); ++at)
    if (counts[at]) both += seen[at] && object[at], either += seen[at] || object[at];
  if (either == 0) return unknown;
  Silhouette silhouette;
  silhouette.iou = static_cast<double>(both) / either;
  const std::vector<char> outline_seen = OutlineOf(seen, width, height),
                          outline_expected = OutlineOf(object, width, height);
  const std::vector<float> to_seen = SquaredDistances(outline_seen, width, height),
                           to_expected = SquaredDistances(outline_expected, width, height);
  double sum = 0;
  int count = 0;
  for (size_t at = 0; at < mask.size(); ++at) {
    if (!counts[at]) continue;
    if (outline_seen[at]) sum += to_expected[at], ++count;
    if (outline_expected[at]) sum += to_seen[at], ++count;
  }
  silhouette.contour_distance_px = count == 0 || sum >= kFar ? NAN : std::sqrt(sum / count);
  return silhouette;
}

}  // namespace touchstone::diagnosis::residuals
