#include "server/session/images/image_set_fix.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/session/csv/fix_text.h"
#include "server/session/measurements/measurement_fix.h"

namespace touchstone::session {
namespace {

absl::Status RefusedImages(const ImageSet& set, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat(set.origin, ": ", what));
}

bool IsTurned(int rotate_deg) {
  return rotate_deg == 90 || rotate_deg == 270;
}

absl::Status CheckImageFix(const ImageSetFix& fix, const ImageSet& set) {
  std::vector<uint64_t> named = fix.drop;
  if (fix.exchange) named.insert(named.end(), {fix.exchange->first, fix.exchange->second});
  for (const uint64_t image : named)
    if (std::none_of(set.photographs.begin(), set.photographs.end(),
                     [&](const PhotographRow& row) { return row.image == image; }))
      return RefusedImages(set, absl::StrCat("has no image ", image));
  if (fix.exchange && fix.exchange->first == fix.exchange->second)
    return RefusedImages(set, "two different images were expected to be exchanged");
  if (fix.exchange && !fix.drop.empty())
    return RefusedImages(set, "pictures are exchanged or dropped, one after the other");
  if (fix.drop.size() >= set.size()) return RefusedImages(set, "no picture would be left");
  if (fix.rotate_deg % 90 != 0 || fix.rotate_deg < 0 || fix.rotate_deg > 270)
    return RefusedImages(set,
                         absl::StrCat("pictures turn by 90, 180 or 270 degrees, not by ", fix.rotate_deg));
  for (const double factor : {fix.scale_camera, fix.scale_focal, fix.scale_lengths})
    if (!(factor > 0 && std::isfinite(factor)))
      return RefusedImages(set, absl::StrCat("a factor above 0 was expected, not ", ShortestNumber(factor)));
  for (const auto& [from, to] : fix.rename_objects) {
    if (std::find(set.objects.begin(), set.objects.end(), from) == set.objects.end())
      return RefusedImages(set, absl::StrCat("has no object '", from, "'", DidYouMean(from, set.objects)));
    if (to.empty()) return RefusedImages(set, "an object needs a name");
  }
  if (std::abs(fix.shift_rows) >= static_cast<int>(set.size()))
    return RefusedImages(
        set, absl::StrCat("has ", set.size(), " rows; they cannot be shifted by ", fix.shift_rows));
  if (!fix.images.empty()) {
    const bool whole = fix.shift_rows != 0 || fix.exchange || !fix.drop.empty() ||
                       !fix.rename_objects.empty() || fix.scale_camera != 1 || fix.scale_focal != 1 ||
                       (IsTurned(fix.rotate_deg) && set.camera.width_px != set.camera.height_px);
    if (whole)
      return RefusedImages(set,
                           "rows, names and the camera (and with it a quarter turn of pictures that are not "
                           "square) belong to all pictures; --images cannot single some out");
    const bool any = std::any_of(set.photographs.begin(), set.photographs.end(), [&](const auto& row) {
      return std::any_of(fix.images.begin(), fix.images.end(), [&](const auto& range) {
        return row.image >= range.first && row.image <= range.second;
      });
    });
    if (!any) return RefusedImages(set, "has none of these pictures");
  }
  if (fix.swap_channels && std::none_of(set.photographs.begin(), set.photographs.end(),
                                        [](const auto& p) { return p.channels == 3; }))
    return RefusedImages(set, "its pictures are grey: they have no channels to exchange");
  return absl::OkStatus();
}

// The picture at (x, y) of the new one, `width` x `height` the old one's.
struct Place {
  int x, y;
};
Place OldPlace(const ImageSetFix& fix, int x, int y, int width, int height) {
  const int new_width = IsTurned(fix.rotate_deg) ? height : width;
  const int new_height = IsTurned(fix.rotate_deg) ? width : height;
  if (fix.mirror == ImageSetFix::Mirror::kLeftRight) x = new_width - 1 - x;
  if (fix.mirror == ImageSetFix::Mirror::kUpDown) y = new_height - 1 - y;
  switch (fix.rotate_deg) {
    case 90:  // clockwise: the old left column, from its foot, is the new top row
      return {y, height - 1 - x};
    case 180:
      return {width - 1 - x, height - 1 - y};
    case 270:
      return {width - 1 - y, x};
    default:
      return {x, y};
  }
}

void FixPixels(const ImageSetFix& fix, int width, int height, PhotographRow* row) {
  const int new_width = IsTurned(fix.rotate_deg) ? height : width;
  const int new_height = IsTurned(fix.rotate_deg) ? width : height;
  const std::vector<uint8_t> old = row->pixels;
  const int channels = row->channels;
  for (int y = 0; y < new_height; ++y)
    for (int x = 0; x < new_width; ++x) {
      const Place from = OldPlace(fix, x, y, width, height);
      for (int c = 0; c < channels; ++c) {
        const int source = fix.swap_channels && channels == 3 ? 2 - c : c;
        row->pixels[(static_cast<size_t>(y) * new_width + x) * channels + c] =
            old[(static_cast<size_t>(from.y) * width + from.x) * channels + source];
      }
    }
}

// Of a set whose pictures all turn. A square picture keeps its camera: it is the files that were turned after it.
void TurnCamera(int rotate_deg, CameraIntrinsics* camera) {
  if (!IsTurned(rotate_deg) || camera->width_px == camera->height_px) return;
  const CameraIntrinsics old = *camera;
  camera->width_px = old.height_px, camera->height_px = old.width_px;
  camera->fx_px = old.fy_px, camera->fy_px = old.fx_px;
  camera->cx_px = rotate_deg == 90 ? old.height_px - old.cy_px : old.cy_px;
  camera->cy_px = rotate_deg == 90 ? old.cx_px : old.width_px - old.cx_px;
}

void FixPlacement(const ImageSetFix& fix, CameraPlacement* placement) {
  placement->eye_m *= fix.scale_lengths;
  placement->at_m *= fix.scale_lengths;
  if (fix.axes)
    for (Eigen::Vector3d* vector : {&placement->eye_m, &placement->at_m, &placement->up})
      *vector = *fix.axes * *vector;
  if (fix.swap_eye_at) std::swap(placement->eye_m, placement->at_m);
  if (fix.up) placement->up = *fix.up;
  if (fix.reverse_up) placement->up = -placement->up;
}

// Returns the rows that stay.
std::vector<int> DropPictures(const std::vector<uint64_t>& images, ImageSet* set) {
  std::vector<int> kept;
  std::vector<PhotographRow> rows;
  for (size_t row = 0; row < set->photographs.size(); ++row) {
    if (std::find(images.begin(), images.end(), set->photographs[row].image) != images.end()) continue;
    kept.push_back(static_cast<int>(row));
    rows.push_back(std::move(set->photographs[row]));
  }
  set->photographs = std::move(rows);
  return kept;
}

PhotographRow* FindPicture(uint64_t image, ImageSet* set) {
  for (PhotographRow& row : set->photographs)
    if (row.image == image) return &row;
  return nullptr;
}

void ExchangePictures(const std::pair<uint64_t, uint64_t>& images, ImageSet* set) {
  PhotographRow &one = *FindPicture(images.first, set), &other = *FindPicture(images.second, set);
  std::swap(one.file, other.file);
  std::swap(one.channels, other.channels);
  std::swap(one.pixels, other.pixels);
}

// The pictures move down by `shift`; returns the rows that have one then.
std::vector<int> ShiftPictures(int shift, ImageSet* set) {
  const std::vector<PhotographRow> old = set->photographs;
  std::vector<int> kept;
  std::vector<PhotographRow> rows;
  for (int row = 0; row < static_cast<int>(old.size()); ++row) {
    const int from = row - shift;
    if (from < 0 || from >= static_cast<int>(old.size())) continue;
    PhotographRow moved = old[row];
    moved.file = old[from].file;
    moved.channels = old[from].channels;
    moved.pixels = old[from].pixels;
    rows.push_back(std::move(moved));
    kept.push_back(row);
  }
  set->photographs = std::move(rows);
  return kept;
}

// Names in the order in which the rows have them first, as in a file.
void RenameAndNumber(const std::vector<std::pair<std::string, std::string>>& renames, ImageSet* set) {
  const std::vector<std::string> old = set->objects;
  set->objects.clear();
  for (PhotographRow& row : set->photographs) {
    std::string name = old[row.object];
    for (const auto& [from, to] : renames)
      if (old[row.object] == from) name = to;
    const auto found = std::find(set->objects.begin(), set->objects.end(), name);
    row.object = static_cast<int>(found - set->objects.begin());
    if (found == set->objects.end()) set->objects.push_back(name);
  }
}

}  // namespace

bool ImageSetFix::empty() const {
  return !plain_text && shift_rows == 0 && !changes_pixels() && rename_objects.empty() && scale_camera == 1 &&
         scale_focal == 1 && scale_lengths == 1 && !axes && !swap_eye_at && !up && !reverse_up && !exchange &&
         drop.empty();
}

absl::StatusOr<std::vector<int>> ApplyFix(const ImageSetFix& fix, ImageSet* set) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckImageFix(fix, *set));
  std::vector<int> left;
  for (int row = 0; row < static_cast<int>(set->size()); ++row) left.push_back(row);
  if (!fix.drop.empty()) left = DropPictures(fix.drop, set);
  if (fix.shift_rows != 0) {
    std::vector<int> shifted;
    for (const int row : ShiftPictures(fix.shift_rows, set)) shifted.push_back(left[row]);
    left = std::move(shifted);
  }
  if (fix.exchange) ExchangePictures(*fix.exchange, set);
  const int width = set->camera.width_px, height = set->camera.height_px;
  for (PhotographRow& row : set->photographs) {
    const bool concerned =
        fix.images.empty() || std::any_of(fix.images.begin(), fix.images.end(), [&](const auto& range) {
          return row.image >= range.first && row.image <= range.second;
        });
    if (!concerned) continue;
    if (fix.changes_pixels()) FixPixels(fix, width, height, &row);
    FixPlacement(fix, &row.commanded);
    if (row.measured) FixPlacement(fix, &*row.measured);
  }
  TurnCamera(fix.rotate_deg, &set->camera);
  for (double* length : {&set->camera.fx_px, &set->camera.fy_px})
    *length *= fix.scale_camera * fix.scale_focal;
  for (double* place : {&set->camera.cx_px, &set->camera.cy_px}) *place *= fix.scale_camera;
  RenameAndNumber(fix.rename_objects, set);
  return left;
}

std::string FixOptions(const ImageSetFix& fix) {
  std::vector<std::string> options;
  if (!fix.images.empty()) {
    std::vector<std::string> ranges;
    for (const auto& [first, last] : fix.images)
      ranges.push_back(first == last ? absl::StrCat(first) : absl::StrCat(first, "-", last));
    options.push_back("--images " + absl::StrJoin(ranges, ","));
  }
  if (fix.plain_text) options.push_back("--plain");
  if (fix.shift_rows != 0) options.push_back(absl::StrCat("--shift-rows=", fix.shift_rows));
  if (fix.rotate_deg != 0) options.push_back(absl::StrCat("--rotate ", fix.rotate_deg));
  if (fix.mirror != ImageSetFix::Mirror::kNone)
    options.push_back(fix.mirror == ImageSetFix::Mirror::kLeftRight ? "--mirror left-right"
                                                                    : "--mirror up-down");
  if (fix.swap_channels) options.push_back("--swap-channels");
  for (std::string& option : RenameOptions(fix.rename_objects)) options.push_back(std::move(option));
  const auto scale = [&](const char* option, double factor) {
    if (factor != 1) options.push_back(absl::StrCat(option, " ", ShortestNumber(factor)));
  };
  scale("--scale-camera", fix.scale_camera);
  scale("--focal-factor", fix.scale_focal);
  scale("--scale-lengths", fix.scale_lengths);
  if (fix.axes) options.push_back("--permute-axes=" + FormatAxes(*fix.axes));
  if (fix.swap_eye_at) options.push_back("--swap-eye-at");
  if (fix.reverse_up) options.push_back("--reverse-up");
  if (fix.exchange)
    options.push_back(absl::StrCat("--exchange ", fix.exchange->first, ",", fix.exchange->second));
  if (!fix.drop.empty()) options.push_back("--drop-images " + absl::StrJoin(fix.drop, ","));
  if (fix.up)
    options.push_back(absl::StrCat("--up=", ShortestNumber(fix.up->x()), ",", ShortestNumber(fix.up->y()),
                                   ",", ShortestNumber(fix.up->z())));
  return absl::StrJoin(options, " ");
}

}  // namespace touchstone::session
