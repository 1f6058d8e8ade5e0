#include "server/diagnosis/images/photographs.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>

#include "server/base/status.h"

namespace touchstone::diagnosis::images {
namespace {

absl::Status CheckPhotographs(const DiagnosisInput& input) {
  if (input.images == nullptr) return absl::InvalidArgumentError("the input holds no photographs");
  const session::ImageSet& set = *input.images;
  if (set.size() == 0) return absl::InvalidArgumentError(absl::StrCat(set.origin, ": no photograph"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckMeshes(input, set.origin, set.objects));
  const size_t pixels = static_cast<size_t>(set.camera.width_px) * set.camera.height_px;
  for (const session::PhotographRow& row : set.photographs)
    if (row.pixels.size() != pixels * row.channels)
      return absl::InvalidArgumentError(
          absl::StrCat(set.origin, ": photograph ", row.image, " (", row.file, ") has ", row.pixels.size(),
                       " values; camera.yaml says ", set.camera.width_px, " x ", set.camera.height_px));
  return absl::OkStatus();
}

image::PhotoRequest RequestOf(const session::ImageSet& set, int row, const Photographs& photographs,
                              uint64_t seed) {
  const session::PhotographRow& from = set.photographs[row];
  const session::CameraIntrinsics& lens = set.camera;
  image::PhotoRequest request;
  request.surface = photographs.surfaces[from.object];
  request.object = set.objects[from.object];
  request.camera.eye_m = from.commanded.eye_m;
  request.camera.at_m = from.commanded.at_m;
  request.camera.up = from.commanded.up;
  request.lens.width = lens.width_px;
  request.lens.height = lens.height_px;
  request.lens.fx_px = lens.fx_px;
  request.lens.fy_px = lens.fy_px;
  request.lens.cx_px = lens.cx_px;
  request.lens.cy_px = lens.cy_px;
  if (lens.k1 != 0 || lens.k2 != 0 || lens.p1 != 0 || lens.p2 != 0 || lens.k3 != 0)
    request.lens.distortion = {lens.k1, lens.k2, lens.p1, lens.p2, lens.k3};
  request.session_time_s = from.session_time_s;
  request.seed = seed;
  request.index = from.image;
  return request;
}

// Equal for photographs of one object from one commanded place.
using PoseKey = std::array<double, 10>;
PoseKey PoseKeyOf(const session::PhotographRow& row) {
  PoseKey key = {static_cast<double>(row.object)};
  for (int axis = 0; axis < 3; ++axis) {
    key[1 + axis] = row.commanded.eye_m[axis];
    key[4 + axis] = row.commanded.at_m[axis];
    key[7 + axis] = row.commanded.up[axis];
  }
  return key;
}

void FindPosesOfPhotographs(Photographs* photographs) {
  std::map<PoseKey, int> poses;
  for (const int row : photographs->row)
    photographs->pose.push_back(
        poses.emplace(PoseKeyOf(photographs->set->photographs[row]), static_cast<int>(poses.size()))
            .first->second);
  photographs->poses = static_cast<int>(poses.size());
}

// Takes photographs out whose pose and pixels are those of one before: as repeats they would show less noise than there is.
void TakeCopiesOut(Photographs* photographs) {
  const std::vector<session::PhotographRow>& all = photographs->set->photographs;
  std::map<PoseKey, std::vector<int>> distinct;
  const auto is_copy = [&](int row) {
    std::vector<int>& others = distinct[PoseKeyOf(all[row])];
    for (const int other : others)
      if (all[other].pixels == all[row].pixels) return true;
    others.push_back(row);
    return false;
  };
  std::vector<int> kept;
  for (const int row : photographs->row)
    if (is_copy(row))
      photographs->copies.push_back(all[row].file);
    else
      kept.push_back(row);
  photographs->row = std::move(kept);
}

// From repeats where there are any, else from neighbouring pixels.
PixelNoise NoiseOf(const Photographs& p, ThreadPool* pool) {
  std::vector<int> first(p.poses, -1), partner(p.size(), -1);
  int pairs = 0;
  for (int k = 0; k < p.size(); ++k) {
    int& other = first[p.pose[k]];
    if (other >= 0) partner[k] = other, ++pairs;
    other = other >= 0 ? -1 : k;
  }
  std::vector<NoiseGatherer> gathered(p.size());
  ParallelFor(pool, p.size(), 1, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) {
      if (pairs == 0) {
        gathered[k].Add(p.measured_grey[k], p.measured_grey[k], p.width(), p.height(), 1);
      } else if (partner[k] >= 0) {
        std::vector<float> difference = p.measured_grey[k];
        for (size_t i = 0; i < difference.size(); ++i) difference[i] -= p.measured_grey[partner[k]][i];
        gathered[k].Add(difference, p.measured_grey[k], p.width(), p.height(), 0.5);
      }
    }
  });
  NoiseGatherer all;
  for (const NoiseGatherer& one : gathered) all.Add(one);
  return all.Estimate();
}

}  // namespace

double Photographs::TimeOf(int k) const {
  return set->has_session_time ? set->photographs[row[k]].session_time_s : row[k];
}

absl::StatusOr<Photographs> MakePhotographs(const DiagnosisInput& input, ThreadPool* pool) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckPhotographs(input));
  Photographs photographs;
  photographs.set = input.images;
  const session::ImageSet& set = *input.images;
  photographs.objects = set.objects;
  for (const std::string& object : set.objects) photographs.surfaces.push_back(input.surfaces.at(object));
  photographs.row.resize(set.size());
  std::iota(photographs.row.begin(), photographs.row.end(), 0);
  std::stable_sort(photographs.row.begin(), photographs.row.end(), [&](int a, int b) {
    const session::PhotographRow &one = set.photographs[a], &other = set.photographs[b];
    if (one.object != other.object) return one.object < other.object;
    return set.has_session_time && one.session_time_s < other.session_time_s;
  });
  TakeCopiesOut(&photographs);
  for (const int row : photographs.row) {
    photographs.object.push_back(set.photographs[row].object);
    photographs.measured_grey.push_back(set.Grey(row));
    photographs.requests.push_back(RequestOf(set, row, photographs, input.seed));
  }
  FindPosesOfPhotographs(&photographs);
  photographs.noise = NoiseOf(photographs, pool);
  photographs.record = std::make_shared<const RecordTable>(photographs.noise);
  return photographs;
}

void ToRecordedMeans(const RecordTable& record, image::Photo* photo) {
  const image::PixelBox& box = photo->varied;
  const int width = photo->width, columns = box.last_column - box.first_column;
  if (columns == width || columns <= 0 || box.last_row <= box.first_row) {
    record.ToMeans(&photo->grey);
    return;
  }
  float* const first = &photo->grey[static_cast<size_t>(box.first_row) * width];
  const float ground = box.first_column > 0 ? first[0] : first[box.last_column];
  for (int row = 0; row < box.last_row - box.first_row; ++row)
    record.ToMeans(first + static_cast<size_t>(row) * width + box.first_column, columns);
  if (const float mean = record.Mean(ground); mean != ground)
    image::FillAround(box, mean, width, &photo->grey);
}

absl::StatusOr<std::vector<image::Photo>> ExpectPhotographs(const Photographs& photographs,
                                                            const model::Model& model, bool details,
                                                            ThreadPool* pool) {
  const image::PhotoSimulator simulator(std::make_shared<const model::Model>(model));
  std::vector<image::Photo> photos(photographs.size());
  std::vector<absl::Status> statuses(photographs.size());
  image::PhotoOutputs outputs;
  outputs.details = details;
  ParallelFor(pool, photographs.size(), 1, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) {
      image::PhotoWorkspace workspace;
      absl::StatusOr<image::Photo> photo = simulator.Run(photographs.requests[k], outputs, &workspace);
      statuses[k] = photo.status();
      if (!photo.ok()) continue;
      ToRecordedMeans(*photographs.record, &*photo);
      photos[k] = *std::move(photo);
    }
  });
  for (const absl::Status& status : statuses) TOUCHSTONE_RETURN_IF_ERROR(status);
  return photos;
}

absl::StatusOr<std::vector<double>> SquaredErrors(const Photographs& photographs, const model::Model& model,
                                                  const std::vector<int>& which, ThreadPool* pool) {
  const image::PhotoSimulator simulator(std::make_shared<const model::Model>(model));
  const int count = static_cast<int>(which.size());
  std::vector<double> squares(count);
  std::vector<absl::Status> statuses(count);
  ParallelFor(pool, count, 1, [&](int begin, int end) {
    image::PhotoWorkspace workspace;
    for (int i = begin; i < end; ++i) {
      const absl::StatusOr<image::Photo> photo =
          simulator.Run(photographs.requests[which[i]], image::PhotoOutputs(), &workspace);
      statuses[i] = photo.status();
      if (!photo.ok()) continue;
      const std::vector<float>& measured = photographs.measured_grey[which[i]];
      for (size_t at = 0; at < measured.size(); ++at) {
        const double residual = static_cast<double>(measured[at]) - photographs.record->Mean(photo->grey[at]);
        squares[i] += residual * residual;
      }
    }
  });
  for (const absl::Status& status : statuses) TOUCHSTONE_RETURN_IF_ERROR(status);
  return squares;
}

double RmseGrey(const Photographs& photographs, const std::vector<image::Photo>& expected) {
  double squares = 0, count = 0;
  for (int k = 0; k < photographs.size(); ++k) {
    const std::vector<float>& measured = photographs.measured_grey[k];
    for (size_t i = 0; i < measured.size(); ++i) {
      const double residual = static_cast<double>(measured[i]) - expected[k].grey[i];
      squares += residual * residual;
    }
    count += static_cast<double>(measured.size());
  }
  return count > 0 ? std::sqrt(squares / count) : 0;
}

}  // namespace touchstone::diagnosis::images
