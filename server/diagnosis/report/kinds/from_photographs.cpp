#include "server/diagnosis/report/kinds/from_photographs.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "server/session/images/emulated.h"

namespace touchstone::diagnosis::report {
namespace {

// Pictures by object, from what they have one by one.
void AddObjectGroups(const images::PhotographDiagnosis& found, DataReport* data) {
  if (found.objects.size() < 2) return;
  const double noise = found.noise_floor.sigma * found.noise_floor.sigma;
  double all = 0;
  for (const images::PhotographError& error : found.photographs)
    all += error.rmse_grey * error.rmse_grey - noise;
  for (const std::string& object : found.objects) {
    double squares = 0, sum = 0;
    int count = 0;
    for (const images::PhotographError& error : found.photographs) {
      if (error.object != object) continue;
      squares += error.rmse_grey * error.rmse_grey, sum += error.mean_residual_grey, ++count;
    }
    if (count == 0) continue;
    data->groups.push_back({residuals::ErrorGroupKind::kObject, object, count, std::sqrt(squares / count),
                            sum / count,
                            all > 0 ? std::clamp((squares - count * noise) / all, 0.0, 1.0) : 0});
  }
}

void AddWhere(const images::PhotographDiagnosis& found, const session::ImageSet& set, DataReport* data) {
  PhotographDescription& description = data->photographs.emplace();
  description.silhouette_iou = found.silhouette_iou;
  description.silhouette_iou_after = found.silhouette_iou_after;
  description.contour_distance_px = found.contour_distance_px;
  description.contour_distance_after_px = found.contour_distance_after_px;
  description.photographs = found.photographs;
  description.maps = found.maps;
  description.coloured = std::any_of(set.photographs.begin(), set.photographs.end(),
                                     [](const session::PhotographRow& row) { return row.channels == 3; });
  for (const images::PhotographSlice& slice : found.where)
    data->where.push_back({slice.slice, slice.words, slice.images, slice.mean_residual_grey, slice.rmse_grey,
                           slice.share_of_excess_error});
  for (const images::PhotographCurve& from : found.curves) {
    Curve curve;
    curve.covariate = from.covariate;
    curve.unit = from.unit;
    curve.p = from.p;
    curve.p_after = from.p_after;
    for (const images::PhotographCurve::Bin& bin : from.bins)
      curve.bins.push_back(
          {"", bin.centre, bin.mean_residual_grey, bin.std_error_grey, bin.after_grey, bin.count});
    data->curves.push_back(std::move(curve));
  }
  AddObjectGroups(found, data);
}

DataReport DataOf(const images::PhotographDiagnosis& found, const session::ImageSet& set) {
  DataReport data;
  data.kind = DataKind::kPhotographs;
  data.session = set.origin;
  data.emulated = session::CountEmulated(set);
  data.content_sha256 = set.sha256;
  data.count = found.images;
  if (found.verdict == engine::Verdict::kTooLittleData) data.needed = found.images_needed;
  std::set<std::vector<double>> poses;
  std::set<int> rounds;
  for (const session::PhotographRow& row : set.photographs) {
    std::vector<double> pose = {static_cast<double>(row.object)};
    for (const Eigen::Vector3d& v : {row.commanded.eye_m, row.commanded.at_m, row.commanded.up})
      pose.insert(pose.end(), v.data(), v.data() + 3);
    poses.insert(pose);
    if (row.round >= 0) rounds.insert(row.round);
  }
  data.rows = static_cast<int>(set.size());
  data.objects = set.objects;
  data.poses = static_cast<int>(poses.size());
  data.repeats = data.count - data.poses;
  data.rounds = static_cast<int>(rounds.size());
  return data;
}

}  // namespace

Diagnosis FromPhotographs(const images::PhotographDiagnosis& found, const session::ImageSet& set) {
  Diagnosis diagnosis;
  diagnosis.model_name = found.model_name;
  diagnosis.model_hash = found.model_hash;
  diagnosis.data = {DataOf(found, set)};
  DataReport& data = diagnosis.data[0];
  data.noise_floor = found.noise_floor;
  data.initial = found.initial;
  data.final = found.final;
  if (data.initial) data.reducible_share = ReducibleShare(found.noise_floor, data.initial->rmse);
  SetNothingMissing(found.nothing_missing, &diagnosis);
  AddWhere(found, set, &data);
  AddImprovement(found, &diagnosis);
  for (const engine::DataProblem& problem : found.data_problems) diagnosis.data_problems.push_back({problem});
  diagnosis.uncertainty = found.uncertainty;
  for (const images::ProposedPhotograph& next : found.next_photographs) diagnosis.next.emplace_back(next);
  diagnosis.warnings = found.warnings;
  diagnosis.duration_s = found.duration_s;
  return diagnosis;
}

}  // namespace touchstone::diagnosis::report
