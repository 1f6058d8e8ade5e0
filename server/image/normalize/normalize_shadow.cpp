#include "server/image/normalize/normalize_shadow.h"

#include <algorithm>
#include <cmath>

namespace touchstone::image {
namespace {

constexpr int kMeetPx = 2;     // blur lies between what meets
constexpr int kRimPx = 2;      // half the width of the rim that blur leaves along an outline
constexpr int kOutlinePx = 9;  // the radius within which an outline is straight or not

bool HasAround(const Region& region, int x, int y, int reach, bool value) {
  for (int dy = -reach; dy <= reach; ++dy)
    for (int dx = -reach; dx <= reach; ++dx)
      if (dx * dx + dy * dy <= reach * reach + 1 && region.Has(x + dx, y + dy) == value) return true;
  return false;
}

Region Grown(const Region& region, int reach) {
  Region grown(region.width, region.height);
  for (int y = 0; y < region.height; ++y)
    for (int x = 0; x < region.width; ++x) grown.at(x, y) = HasAround(region, x, y, reach, true);
  return grown;
}

Region Shrunk(const Region& region, int reach) {
  Region shrunk(region.width, region.height);
  for (int y = 0; y < region.height; ++y)
    for (int x = 0; x < region.width; ++x) shrunk.at(x, y) = !HasAround(region, x, y, reach, false);
  return shrunk;
}

Region Joined(const Region& a, const Region& b) {
  Region joined = a;
  for (size_t k = 0; k < b.inside.size(); ++k) joined.inside[k] |= b.inside[k];
  return joined;
}

// The share of the disc around a pixel that the region has, less a half: 0 for a straight outline.
double BendAt(const Region& region, int x, int y) {
  int inside = 0, all = 0;
  for (int dy = -kOutlinePx; dy <= kOutlinePx; ++dy)
    for (int dx = -kOutlinePx; dx <= kOutlinePx; ++dx) {
      if (dx * dx + dy * dy > kOutlinePx * kOutlinePx) continue;
      ++all;
      inside += region.Has(x + dx, y + dy);
    }
  return std::abs(static_cast<double>(inside) / all - 0.5);
}

// Whether a pixel of `whole` that is not of `part` lies near.
bool MeetsRest(const Region& part, const Region& whole, int x, int y) {
  for (int dy = -kMeetPx; dy <= kMeetPx; ++dy)
    for (int dx = -kMeetPx; dx <= kMeetPx; ++dx)
      if (whole.Has(x + dx, y + dy) && !part.Has(x + dx, y + dy)) return true;
  return false;
}

}  // namespace

Beside LookBeside(const Region& part, const Region& around, const Plane& slope) {
  Region rest(part.width, part.height);
  for (size_t k = 0; k < rest.inside.size(); ++k)
    rest.inside[k] = around.inside[k] != 0 && part.inside[k] == 0;
  rest = Grown(Shrunk(rest, kRimPx), kRimPx);
  const Region whole = Joined(part, rest);
  Beside beside;
  int border = 0;
  for (int y = 0; y < whole.height; ++y)
    for (int x = 0; x < whole.width; ++x) {
      beside.pixels += whole.at(x, y) != 0 && part.at(x, y) == 0;
      const bool on_outline = part.at(x, y) != 0 && (!part.Has(x - 1, y) || !part.Has(x + 1, y) ||
                                                     !part.Has(x, y - 1) || !part.Has(x, y + 1));
      if (!on_outline || !MeetsRest(part, whole, x, y)) continue;
      ++border;
      beside.border_slope += slope.at(x, y);
      if (!HasAround(whole, x, y, kMeetPx, false)) continue;
      ++beside.junctions;
      beside.part_bend += BendAt(part, x, y);
      beside.whole_bend += BendAt(whole, x, y);
    }
  beside.border_slope /= std::max(border, 1);
  beside.part_bend /= std::max(beside.junctions, 1);
  beside.whole_bend /= std::max(beside.junctions, 1);
  return beside;
}

Region Closed(const Region& region, int reach) {
  return Joined(region, Shrunk(Grown(region, reach), reach));
}

}  // namespace touchstone::image
