#include "server/diagnosis/images/rows/photo_flow.h"

#include <algorithm>
#include <cmath>

#include "server/diagnosis/images/rows/rules.h"

namespace touchstone::diagnosis::images {
namespace {

// Pixels without a displacement take the mean of their neighbours that have one.
void Spread(int width, int height, std::vector<uint8_t>* known, std::vector<Eigen::Vector2f>* move_px) {
  const auto for_neighbours = [&](int at, const auto& visit) {
    const int x = at % width;
    if (x > 0) visit(at - 1);
    if (x + 1 < width) visit(at + 1);
    if (at >= width) visit(at - width);
    if (at + width < width * height) visit(at + width);
  };
  std::vector<int> latest, border;  // known since the last pass; unknown beside those
  for (int at = 0; at < width * height; ++at)
    if ((*known)[at]) latest.push_back(at);
  std::vector<Eigen::Vector2f> means;
  std::vector<uint8_t> reached = *known;
  for (int pass = 0; pass < kPhotoRowRules.around_px; ++pass) {
    border.clear(), means.clear();
    for (const int from : latest)
      for_neighbours(from, [&](int at) {
        if (reached[at]) return;
        reached[at] = 1;
        border.push_back(at);
      });
    for (const int at : border) {
      Eigen::Vector2f sum = Eigen::Vector2f::Zero();
      int count = 0;
      for_neighbours(at, [&](int other) {
        if (!(*known)[other]) return;
        sum += (*move_px)[other];
        ++count;
      });
      means.push_back(sum / static_cast<float>(count));
    }
    for (size_t i = 0; i < border.size(); ++i) {
      (*known)[border[i]] = 1;
      (*move_px)[border[i]] = means[i];
    }
    latest = border;
  }
}

}  // namespace

PictureFlow FlowOfPicture(const image::PhotoRequest& request, const image::Photo& photo,
                          const std::vector<float>& wanted, const image::PhotoSimulator& from,
                          const image::PhotoSimulator& to) {
  std::vector<int> pixels;
  std::vector<Eigen::Vector3f> points_m;
  for (int at = 0; at < static_cast<int>(wanted.size()); ++at) {
    if (!(wanted[at] > 0) || photo.mask[at] == 0) continue;
    pixels.push_back(at);
    points_m.push_back(photo.point_m[at]);
  }
  const std::vector<Eigen::Vector2d> here = from.Project(request, points_m),
                                     there = to.Project(request, points_m);
  PictureFlow flow;
  flow.move_px.assign(wanted.size(), Eigen::Vector2f::Zero());
  std::vector<uint8_t> known(wanted.size(), 0);
  for (size_t i = 0; i < pixels.size(); ++i) {
    const Eigen::Vector2f move_px = (there[i] - here[i]).cast<float>();
    if (!move_px.allFinite()) continue;
    flow.move_px[pixels[i]] = move_px;
    known[pixels[i]] = 1;
    flow.farthest_px = std::max(flow.farthest_px, move_px.norm());
  }
  Spread(photo.width, photo.height, &known, &flow.move_px);
  return flow;
}

std::vector<float> CarriedBy(const PictureFlow& flow, const image::Photo& photo,
                             const std::vector<float>& grey) {
  std::vector<float> change(grey.size(), 0.0f);
  // The displacement of what lies nearer decides where two pixels differ; half of what flows between them to each.
  const auto between = [&](int one, int other, int axis) {
    const float step = grey[other] - grey[one];
    if (step == 0) return;
    int near = one;
    if (photo.mask[one] != 0 && photo.mask[other] != 0) {
      near = photo.depth_m[other] < photo.depth_m[one] ? other : one;
    } else if (photo.mask[other] != 0) {
      near = other;
    }
    const float half = -0.5f * step * flow.move_px[near][axis];
    change[one] += half;
    change[other] += half;
  };
  for (int y = 0; y < photo.height; ++y)
    for (int x = 0; x < photo.width; ++x) {
      const int at = y * photo.width + x;
      if (x + 1 < photo.width) between(at, at + 1, 0);
      if (y + 1 < photo.height) between(at, at + photo.width, 1);
    }
  return change;
}

}  // namespace touchstone::diagnosis::images
