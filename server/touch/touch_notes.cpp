#include "server/touch/touch_notes.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/geometry/files/plausible_size.h"

namespace touchstone::touch {
namespace {

using Points = std::vector<Eigen::Vector3d>;

// Along `direction` seen, whether the front of the triangle is hit, as its corners run.
bool HitsFront(const geometry::Surface& surface, uint32_t triangle, const Eigen::Vector3d& direction) {
  const Eigen::Vector3d a = surface.mesh().Corner(triangle, 0), b = surface.mesh().Corner(triangle, 1),
                        c = surface.mesh().Corner(triangle, 2);
  return (b - a).cross(c - a).dot(direction) < 0;
}

// Which starts are inside of the object, [start]: what is met from there on is left, not entered. The first triangle
// that the same line meets from outside is entered, whichever way the mesh's triangles run.
std::vector<char> Inside(const geometry::Surface& surface, const Points& starts_m, const Points& directions) {
  const double outside_m = 2 * surface.bounds().DiagonalM();
  Points backward, outside;
  for (size_t k = 0; k < starts_m.size(); ++k) {
    backward.push_back(-directions[k]);
    const double to_box_m = (starts_m[k] - surface.bounds().Centre()).norm();
    outside.push_back(starts_m[k] - (outside_m + to_box_m) * directions[k]);
  }
  geometry::Contacts behind, entry, ahead;
  surface.CastLines(starts_m, backward, kNoStrokeLimitM, &behind);
  surface.CastLines(outside, directions, kNoStrokeLimitM, &entry);
  surface.CastLines(starts_m, directions, kNoStrokeLimitM, &ahead);
  std::vector<char> inside(starts_m.size(), 0);
  for (size_t k = 0; k < starts_m.size(); ++k) {
    if (behind.triangle[k] == geometry::kNoTriangle || entry.triangle[k] == geometry::kNoTriangle ||
        ahead.triangle[k] == geometry::kNoTriangle)
      continue;
    inside[k] = HitsFront(surface, entry.triangle[k], directions[k]) !=
                HitsFront(surface, ahead.triangle[k], directions[k]);
  }
  return inside;
}

// The first touch that starts inside, how many do, and the standoff that would be right for the first; empty: none.
std::string StartNote(const geometry::Surface& surface, const model::Model& model,
                      absl::Span<const CommandedTouch> touches, uint64_t first_number) {
  Points starts_m, directions;
  for (const CommandedTouch& touch : touches)
    for (int finger = 0; finger < model.fingers; ++finger) {
      const double x_m = (finger - 0.5 * (model.fingers - 1)) * model.spacing_m;
      starts_m.push_back(touch.target_m - touch.approach * touch.standoff_m + touch.lateral * x_m);
      directions.push_back(touch.approach);
    }
  const std::vector<char> inside = Inside(surface, starts_m, directions);
  size_t count = 0, first = 0;
  double needed_m = 0;
  for (size_t k = 0; k < touches.size(); ++k) {
    double leaves_m = 0;
    bool any = false;
    for (int finger = 0; finger < model.fingers; ++finger) {
      const size_t start = k * model.fingers + finger;
      if (!inside[start]) continue;
      any = true;
      leaves_m = std::max(leaves_m, DistanceToLeave(surface.bounds(), starts_m[start], -directions[start]));
    }
    if (!any || count++ > 0) continue;
    first = k;
    needed_m = touches[k].standoff_m + leaves_m;
  }
  if (count == 0) return "";
  const double standoff_mm = FromSi(Unit::kMillimetre, touches[first].standoff_m);
  return absl::StrCat(
      "touch ", first_number + first,
      count > 1 ? absl::StrCat(" and ", count - 1, count > 2 ? " others start" : " other start") : " starts",
      " inside of '", surface.name(), "': a standoff of ", ShortestNumber(std::round(standoff_mm * 10) / 10),
      " mm begins within the object", count > 1 ? " at the first" : "", "; from ",
      std::ceil(FromSi(Unit::kMillimetre, needed_m)), " mm on it would begin outside");
}

}  // namespace

double HandSpanM(const model::Model& model) {
  return std::max(1, model.fingers - 1) * model.spacing_m;
}

std::vector<std::string> NotesOnTouches(const geometry::Surface& surface, const model::Model& model,
                                        absl::Span<const CommandedTouch> touches, uint64_t first_number) {
  std::vector<std::string> notes;
  const std::string size = geometry::SizeNote(surface.bounds(), HandSpanM(model));
  if (!size.empty()) notes.push_back(absl::StrCat("'", surface.name(), "': ", size));
  const std::string start = StartNote(surface, model, touches, first_number);
  if (!start.empty()) notes.push_back(start);
  return notes;
}

}  // namespace touchstone::touch
