#include "server/diagnosis/report/kinds/from_touches.h"

#include <utility>

#include "server/model/finger_name.h"

namespace touchstone::diagnosis::report {
namespace {

Group GroupOf(const residuals::ErrorGroup& from) {
  return {from.kind,
          from.name,
          from.touches,
          Microseconds(from.rmse_s),
          Microseconds(from.mean_residual_s),
          from.share_of_excess_error};
}

Curve CurveOf(const residuals::ResidualCurve& from, const std::vector<std::string>& fingers) {
  Curve curve;
  curve.covariate = from.covariate;
  curve.unit = from.unit;
  curve.p = from.p_value;
  curve.p_after = from.improved_p_value;
  for (const residuals::FingerDependence& own : from.fingers)
    curve.fingers.push_back({fingers[own.finger], own.p_value, own.improved_p_value});
  for (const residuals::ResidualCurveBin& bin : from.bins)
    curve.bins.push_back({fingers[bin.finger], bin.centre, Microseconds(bin.mean_residual_s),
                          Microseconds(bin.std_error_s), Microseconds(bin.improved_mean_residual_s),
                          bin.touches});
  return curve;
}

}  // namespace

DataReport DataOfTouches(const touches::DataSummary& set) {
  DataReport data;
  data.kind = DataKind::kTouches;
  data.session = set.origin;
  data.count = set.touches;
  for (const auto& [reason, unused] : set.unused)
    data.set_aside.rows.push_back({reason, unused.count, {unused.examples.begin(), unused.examples.end()}});
  data.set_aside.outliers = set.outliers;
  data.rows = set.rows;
  data.poses = set.poses;
  data.repeats = set.repeats;
  data.rounds = set.rounds;
  data.missed_contacts = set.missed_contacts;
  data.objects = set.objects;
  data.speeds_mm_s = set.speeds_mm_s;
  for (int finger = 0; finger < set.fingers; ++finger)
    data.fingers.push_back(model::FingerName(finger, set.fingers));
  return data;
}

Slice SliceOf(const residuals::ErrorSlice& from) {
  return {from.conditions,
          from.words,
          from.touches,
          Microseconds(from.mean_residual_s),
          Microseconds(from.rmse_s),
          from.share_of_excess_error};
}

NoiseFloor InMicroseconds(NoiseFloor floor) {
  for (double* time : {&floor.sigma, &floor.lower, &floor.upper, &floor.declared, &floor.sigma_without_time})
    *time = Microseconds(*time);
  return floor;
}

DataProblem InMicroseconds(const engine::DataProblem& from) {
  DataProblem problem{from};
  problem.error_before = Microseconds(from.error_before);
  problem.error_after = Microseconds(from.error_after);
  return problem;
}

void AddLadder(const selection::Ladder& ladder, Diagnosis* diagnosis) {
  DataReport& data = diagnosis->data[0];
  AddImprovement(ladder, diagnosis);
  data.noise_floor = InMicroseconds(ladder.noise_floor);
  data.final = InMicroseconds(ladder.final);
  data.set_aside.judged = ladder.set_aside.words;
  data.reducible_share = ReducibleShare(*data.noise_floor, data.initial->rmse);
  for (Quality& quality : data.after_step) quality = InMicroseconds(quality);
  for (Candidate& candidate : data.candidates) candidate = InMicroseconds(candidate);
  if (data.unexplained) data.unexplained = InMicroseconds(*data.unexplained);
  if (!ladder.dropouts.empty()) diagnosis->warnings.push_back(ladder.dropouts);
  diagnosis->posterior = ladder.posterior;
}

void AddResiduals(residuals::ResidualSummary residuals, DataReport* data) {
  for (const residuals::ErrorSlice& slice : residuals.slices) data->where.push_back(SliceOf(slice));
  for (const residuals::ErrorGroup& group : residuals.grouped.groups) data->groups.push_back(GroupOf(group));
  for (const residuals::ResidualCurve& curve : residuals.curves)
    data->curves.push_back(CurveOf(curve, data->fingers));
  data->finger_bias_s = std::move(residuals.grouped.finger_bias_s);
  if (!data->noise_floor || !data->noise_floor->is_rounding) data->finger_scatter = residuals.finger_scatter;
  data->worst_touches = std::move(residuals.worst_touches);
  data->histograms = std::move(residuals.histograms);
  data->parity = std::move(residuals.parity);
  data->surface_points = std::move(residuals.surface_points);
  data->outlines = std::move(residuals.outlines);
  data->table = std::move(residuals.table);
}

}  // namespace touchstone::diagnosis::report
