#include "server/diagnosis/report/write_photograph_report.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "server/diagnosis/report/message_parts.h"
#include "server/image/encode.h"

namespace touchstone::diagnosis::report {
namespace {

constexpr double kMinScaleGrey = 8;    // of residual maps
constexpr double kScaleShare = 0.995;  // of the pixels that the scale covers

void WriteGreyQuality(const engine::Quality& quality, v1::Quality* message) {
  message->set_rmse_grey(quality.rmse);
  message->set_heldout_rmse_grey(quality.heldout_rmse);
  message->set_lack_of_fit_p(quality.lack_of_fit_p);
}

void WritePhotographStep(const engine::LadderStep& step, v1::Step* message) {
  WriteStepWithoutErrors(step, message);
  message->set_rmse_grey(step.quality.rmse);
  message->set_heldout_rmse_grey(step.quality.heldout_rmse);
}

void WriteUnexplainedPhotographs(const engine::UnexplainedRest& rest, v1::Unexplained* message) {
  WriteRestWithoutErrors(rest, message);
  message->set_rmse_grey(rest.rmse);
  message->set_heldout_rmse_grey(rest.heldout_rmse);
}

void WritePhotographCauses(const images::PhotographDiagnosis& diagnosis, v1::Report* report) {
  WriteModelChanges(diagnosis, report);
  for (const engine::LadderStep& step : diagnosis.steps) WritePhotographStep(step, report->add_steps());
  for (const engine::RankedCandidate& candidate : diagnosis.candidates) {
    v1::Candidate* message = report->add_candidates();
    WriteCandidateWithoutErrors(candidate, message);
    message->set_rmse_grey(candidate.rmse);
    message->set_heldout_rmse_grey(candidate.heldout_rmse);
  }
  if (diagnosis.unexplained)
    WriteUnexplainedPhotographs(*diagnosis.unexplained, report->mutable_unexplained());
  for (const engine::DataProblem& problem : diagnosis.data_problems) {
    v1::DataProblem* message = report->add_data_problems();
    WriteProblemWithoutErrors(problem, message);
    message->set_rmse_before_grey(problem.error_before);
    message->set_rmse_after_grey(problem.error_after);
  }
}

std::string PngOf(const std::vector<uint8_t>& pixels, int width, int height, int channels) {
  return image::EncodePng(pixels.data(), width, height, channels).value_or("");
}

void WriteMap(const images::PhotographMap& map, v1::PhotographMap* message) {
  message->set_image(map.image);
  message->set_object(map.object);
  const int width = map.width, height = map.height;
  message->set_measured_png(PngOf(map.measured, width, height, 1));
  message->set_before_png(PngOf(map.before, width, height, 1));
  message->set_after_png(PngOf(map.after, width, height, 1));
  // One scale for both, so that what has fallen looks as if it had.
  std::vector<float> sizes = map.residual_before_grey;
  for (float& size : sizes) size = std::abs(size);
  const size_t place = std::min(sizes.size() - 1, static_cast<size_t>(kScaleShare * sizes.size()));
  std::nth_element(sizes.begin(), sizes.begin() + place, sizes.end());
  const double scale = std::max(kMinScaleGrey, std::ceil(static_cast<double>(sizes[place])));
  message->set_residual_scale_grey(scale);
  message->set_residual_before_png(PngOf(ResidualColours(map.residual_before_grey, scale), width, height, 3));
  message->set_residual_after_png(PngOf(ResidualColours(map.residual_after_grey, scale), width, height, 3));
}

void WriteWherePhotographs(const images::PhotographDiagnosis& diagnosis, v1::Report* report) {
  v1::PhotographSummary* summary = report->mutable_photographs();
  summary->set_silhouette_iou(diagnosis.silhouette_iou);
  summary->set_silhouette_iou_after(diagnosis.silhouette_iou_after);
  summary->set_contour_distance_px(diagnosis.contour_distance_px);
  summary->set_contour_distance_after_px(diagnosis.contour_distance_after_px);
  for (const images::PhotographError& error : diagnosis.photographs) {
    v1::PhotographError* message = summary->add_photographs();
    message->set_image(error.image);
    message->set_object(error.object);
    message->set_rmse_grey(error.rmse_grey);
    message->set_rmse_after_grey(error.rmse_after_grey);
    message->set_mean_residual_grey(error.mean_residual_grey);
    message->set_silhouette_iou(error.silhouette_iou);
    message->set_contour_distance_px(error.contour_distance_px);
  }
  for (const images::PhotographMap& map : diagnosis.maps)
    if (!map.residual_before_grey.empty()) WriteMap(map, summary->add_maps());
  for (const images::PhotographSlice& slice : diagnosis.where) {
    v1::Slice* message = report->add_where();
    message->set_slice(slice.slice);
    message->set_images(static_cast<uint32_t>(slice.images));
    message->set_mean_residual_grey(slice.mean_residual_grey);
    message->set_rmse_grey(slice.rmse_grey);
    message->set_share_of_excess_error(slice.share_of_excess_error);
    message->set_words(slice.words);
  }
  for (const images::PhotographCurve& curve : diagnosis.curves) {
    v1::CovariateCurve* message = report->add_curves();
    message->set_covariate(curve.covariate);
    message->set_unit(curve.unit);
    message->set_p(curve.p);
    message->set_p_after(curve.p_after);
    for (const images::PhotographCurve::Bin& bin : curve.bins) {
      v1::CurveBin* to = message->add_bins();
      to->set_centre(bin.centre);
      to->set_mean_residual_grey(bin.mean_residual_grey);
      to->set_std_error_grey(bin.std_error_grey);
      to->set_after_grey(bin.after_grey);
      to->set_count(static_cast<uint32_t>(std::min<int64_t>(bin.count, UINT32_MAX)));
    }
  }
}

// Pictures by object, from what they have one by one.
void WriteObjectGroups(const images::PhotographDiagnosis& diagnosis, v1::Report* report) {
  if (diagnosis.objects.size() < 2) return;
  const double noise = diagnosis.noise_floor.sigma * diagnosis.noise_floor.sigma;
  double all = 0;
  for (const images::PhotographError& error : diagnosis.photographs)
    all += error.rmse_grey * error.rmse_grey - noise;
  for (const std::string& object : diagnosis.objects) {
    double squares = 0, sum = 0;
    uint32_t count = 0;
    for (const images::PhotographError& error : diagnosis.photographs) {
      if (error.object != object) continue;
      squares += error.rmse_grey * error.rmse_grey, sum += error.mean_residual_grey, ++count;
    }
    if (count == 0) continue;
    v1::GroupError* group = report->add_groups();
    group->set_kind("object");
    group->set_name(object);
    group->set_images(count);
    group->set_rmse_grey(std::sqrt(squares / count));
    group->set_mean_residual_grey(sum / count);
    group->set_share_of_excess_error(all > 0 ? std::clamp((squares - count * noise) / all, 0.0, 1.0) : 0);
  }
}

// Only what is not known from touches already.
void WriteSetOfPhotographs(const session::ImageSet& set, v1::Report* report) {
  v1::DataSummary* data = report->mutable_data();
  std::set<std::vector<double>> poses;
  std::set<int> rounds;
  for (const session::PhotographRow& row : set.photographs) {
    std::vector<double> pose = {static_cast<double>(row.object)};
    for (const Eigen::Vector3d& v : {row.commanded.eye_m, row.commanded.at_m, row.commanded.up})
      pose.insert(pose.end(), v.data(), v.data() + 3);
    poses.insert(pose);
    if (row.round >= 0) rounds.insert(row.round);
  }
  if (data->rows() > 0) return;
  data->set_origin(set.origin);
  data->set_rows(static_cast<uint32_t>(set.size()));
  for (const std::string& object : set.objects) data->add_objects(object);
  data->set_poses(static_cast<uint32_t>(poses.size()));
  data->set_repeats(static_cast<uint32_t>(set.size() - poses.size()));
  data->set_rounds(static_cast<uint32_t>(rounds.size()));
}

}  // namespace

std::vector<uint8_t> ResidualColours(const std::vector<float>& residual_grey, double scale_grey) {
  std::vector<uint8_t> rgb(3 * residual_grey.size());
  for (size_t at = 0; at < residual_grey.size(); ++at) {
    const double share = std::clamp(residual_grey[at] / scale_grey, -1.0, 1.0);
    const uint8_t pale = static_cast<uint8_t>(std::lround(255 * (1 - std::abs(share))));
    rgb[3 * at] = share < 0 ? pale : 255;
    rgb[3 * at + 1] = pale;
    rgb[3 * at + 2] = share > 0 ? pale : 255;
  }
  return rgb;
}

void WritePhotographs(const images::PhotographDiagnosis& diagnosis, const session::ImageSet& set,
                      v1::Report* report) {
  WriteSetOfPhotographs(set, report);
  report->set_verdict(ToMessage(diagnosis.verdict));
  report->set_model_name(diagnosis.model_name);
  report->set_model_hash(diagnosis.model_hash);
  report->set_images(static_cast<uint32_t>(diagnosis.images));
  report->set_noise_floor_grey(diagnosis.noise_floor.sigma);
  v1::NoiseFloor* floor = report->mutable_noise_floor();
  floor->set_sigma_grey(diagnosis.noise_floor.sigma);
  floor->set_lower_grey(diagnosis.noise_floor.lower);
  floor->set_upper_grey(diagnosis.noise_floor.upper);
  if (report->touches() == 0) {
    floor->set_from_repeats(diagnosis.noise_floor.from_repeats);
    floor->set_degrees_of_freedom(
        static_cast<uint32_t>(std::min(diagnosis.noise_floor.degrees_of_freedom, 4e9)));
  }
  if (diagnosis.initial) WriteGreyQuality(*diagnosis.initial, report->mutable_initial());
  if (diagnosis.final) WriteGreyQuality(*diagnosis.final, report->mutable_final());
  report->set_reducible_share(diagnosis.reducible_share);
  WriteWherePhotographs(diagnosis, report);
  WriteObjectGroups(diagnosis, report);
  WritePhotographCauses(diagnosis, report);
  for (const images::ProposedPhotograph& proposed : diagnosis.next_photographs) {
    v1::ProposedPhotograph* message = report->add_next_photographs();
    message->set_object(proposed.object);
    message->set_purpose(proposed.purpose);
    message->set_separation(proposed.separation);
    message->set_photographs_to_verdict(static_cast<uint32_t>(proposed.photographs_to_verdict));
    const auto write = [](const Eigen::Vector3d& from, v1::Vector3* to) {
      to->set_x(from.x()), to->set_y(from.y()), to->set_z(from.z());
    };
    write(proposed.camera.eye_m, message->mutable_camera()->mutable_eye_m());
    write(proposed.camera.at_m, message->mutable_camera()->mutable_at_m());
    write(proposed.camera.up, message->mutable_camera()->mutable_up());
  }
  report->set_summary(diagnosis.summary);
  for (const std::string& warning : diagnosis.warnings) report->add_warnings(warning);
  report->set_duration_s(diagnosis.duration_s);
  if (diagnosis.verdict == engine::Verdict::kTooLittleData)
    report->set_touches_needed(static_cast<uint32_t>(diagnosis.images_needed));
}

}  // namespace touchstone::diagnosis::report
