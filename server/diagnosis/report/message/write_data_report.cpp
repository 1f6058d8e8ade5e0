#include "server/diagnosis/report/message/write_data_report.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>

#include "server/diagnosis/report/message/message_parts.h"
#include "server/diagnosis/report/message/write_answers.h"
#include "server/effects/formula/formula.h"
#include "server/model/finger_name.h"

namespace touchstone::diagnosis::report {
namespace {

uint32_t Unsigned(double value) {
  return static_cast<uint32_t>(std::clamp(value, 0.0, 4e9));
}

const char* InWords(engine::CandidateNote note) {
  switch (note) {
    case engine::CandidateNote::kNone:
      return "";
    case engine::CandidateNote::kInvisible:
      return "this experiment cannot see it";
    case engine::CandidateNote::kNeutral:
      return "fits best where it changes nothing";
    case engine::CandidateNote::kAtBound:
      return "its best value lies at its bound";
    case engine::CandidateNote::kLinearised:
      return "not among the eight most probable; its gain is a linearised prediction";
  }
  return "";
}

void WriteSetAside(const SetAside& set_aside, v1::SetAside* message) {
  std::vector<std::string> words;
  for (const SetAside::Rows& unused : set_aside.rows) {
    v1::UnusedRows* rows = message->add_rows();
    rows->set_rows(Unsigned(unused.count));
    rows->set_reason(unused.reason);
    *rows->mutable_examples() = {unused.examples.begin(), unused.examples.end()};
    words.push_back(absl::StrCat(unused.count, ": ", unused.reason));
  }
  message->set_count(Unsigned(set_aside.count()));
  message->set_words(
      absl::StrCat(absl::StrJoin(words, "; "), set_aside.judged.empty() ? "" : ". " + set_aside.judged));
  message->set_outliers(Unsigned(set_aside.outliers));
}

void WriteErrors(const DataReport& data, v1::DataReport* message) {
  if (data.noise_floor) {
    message->set_noise_floor(data.noise_floor->sigma);
    v1::NoiseFloor* noise = message->mutable_noise();
    noise->set_degrees_of_freedom(Unsigned(data.noise_floor->degrees_of_freedom));
    noise->set_lower(data.noise_floor->lower);
    noise->set_upper(data.noise_floor->upper);
    noise->set_from_repeats(data.noise_floor->from_repeats);
    noise->set_is_rounding(data.noise_floor->is_rounding);
  }
  if (data.initial) WriteQuality(*data.initial, message->mutable_initial());
  for (const Quality& quality : data.after_step) WriteQuality(quality, message->add_after_step());
  if (data.final) WriteQuality(*data.final, message->mutable_final());
  message->set_reducible_share(data.reducible_share);
  if (data.versus) WriteVersus(*data.versus, data.fingers, message->mutable_versus());
}

void WriteWhere(const DataReport& data, v1::DataReport* message) {
  for (const Slice& slice : data.where) WriteSlice(slice, message->add_where());
  for (const Group& group : data.groups) {
    v1::GroupError* to = message->add_groups();
    static_assert(static_cast<int>(residuals::ErrorGroupKind::kSpeed) + 1 == v1::GroupError::SPEED);
    to->set_kind(static_cast<v1::GroupError::Kind>(static_cast<int>(group.kind) + 1));
    to->set_name(group.name);
    to->set_count(Unsigned(group.count));
    to->set_rmse(group.rmse);
    to->set_mean_residual(group.mean_residual);
    to->set_share_of_excess_error(group.share_of_excess_error);
  }
}

void WriteCovariateCurve(const Curve& curve, v1::CovariateCurve* message) {
  message->set_covariate(curve.covariate);
  message->set_unit(curve.unit);
  message->set_p(curve.p);
  message->set_p_after(curve.p_after);
  for (const Curve::OfFinger& own : curve.fingers) {
    v1::FingerDependence* finger = message->add_fingers();
    finger->set_finger(own.finger);
    finger->set_p(own.p);
    finger->set_p_after(own.p_after);
  }
  for (const Curve::Bin& bin : curve.bins) {
    v1::CurveBin* to = message->add_bins();
    to->set_finger(bin.finger);
    to->set_centre(bin.centre);
    to->set_mean_residual(bin.mean_residual);
    to->set_std_error(bin.std_error);
    to->set_after(bin.after);
    to->set_count(Unsigned(static_cast<double>(bin.count)));
  }
}

void WriteLookup(const model::LookupSpec& lookup, v1::UnexplainedCurve* message) {
  message->set_covariate(lookup.covariate);
  for (const effects::FormulaVariable& variable : effects::FormulaVariables())
    if (lookup.covariate == variable.name) message->set_covariate_unit(variable.unit);
  message->set_unit(lookup.adds_time ? "us" : "mm");
  *message->mutable_knots() = {lookup.knots.begin(), lookup.knots.end()};
  const int lists = static_cast<int>(lookup.values.size());
  for (int i = 0; i < lists; ++i) {
    v1::FingerCurve* curve = message->add_curves();
    if (lists > 1) curve->set_finger(model::FingerName(i, lists));
    *curve->mutable_values() = {lookup.values[i].begin(), lookup.values[i].end()};
  }
}

void WriteUnexplained(const Unexplained& rest, v1::Unexplained* message) {
  for (const engine::CovariateTest& test : rest.covariates) {
    v1::CovariateTest* covariate = message->add_covariates();
    covariate->set_name(test.name);
    covariate->set_p(test.p);
    covariate->set_gain_nats(test.gain_nats);
  }
  message->set_formula(rest.formula);
  message->set_formula_yaml(rest.formula_yaml);
  message->set_lookup_yaml(rest.lookup_yaml);
  message->set_heldout_gain(rest.heldout_gain);
  message->set_words(rest.words);
  WriteParameters(rest.parameters, message->mutable_parameters());
  message->set_rmse(rest.rmse);
  message->set_heldout_rmse(rest.heldout_rmse);
  message->set_nearest_effect(rest.nearest_effect);
  message->set_nearest_cosine(rest.nearest_cosine);
  message->set_nearest_formula(rest.nearest_formula);
  message->set_nearest_formula_share(rest.nearest_formula_share);
  if (rest.lookup != nullptr) WriteLookup(*rest.lookup->lookup, message->mutable_curve());
}

void WriteCandidate(const Candidate& candidate, v1::Candidate* message) {
  message->set_effect(candidate.effect);
  WriteParameters(candidate.parameters, message->mutable_parameters());
  message->set_probability(candidate.probability);
  message->set_rmse(candidate.rmse);
  message->set_heldout_rmse(candidate.heldout_rmse);
  message->set_gain_nats(candidate.gain_nats);
  message->set_note(InWords(candidate.note));
  *message->mutable_scope() = ScopeMessage(candidate.scope, candidate.parameters);
}

void WriteLens(const boards::BoardLens& lens, v1::LensReport* message) {
  const session::CameraIntrinsics& camera = lens.camera;
  message->set_width_px(Unsigned(camera.width_px));
  message->set_height_px(Unsigned(camera.height_px));
  message->set_fx_px(camera.fx_px);
  message->set_fy_px(camera.fy_px);
  message->set_cx_px(camera.cx_px);
  message->set_cy_px(camera.cy_px);
  message->set_k1(camera.k1);
  message->set_k2(camera.k2);
  message->set_p1(camera.p1);
  message->set_p2(camera.p2);
  message->set_k3(camera.k3);
  message->set_fx_std_error_px(lens.fx_error_px);
  message->set_fy_std_error_px(lens.fy_error_px);
  message->set_cx_std_error_px(lens.cx_error_px);
  message->set_cy_std_error_px(lens.cy_error_px);
}

void WriteSet(const DataReport& data, v1::DataSummary* message) {
  message->set_rows(Unsigned(data.rows));
  *message->mutable_objects() = {data.objects.begin(), data.objects.end()};
  message->set_poses(Unsigned(data.poses));
  message->set_rounds(Unsigned(data.rounds));
  message->set_repeats(Unsigned(data.repeats));
  *message->mutable_speeds_mm_s() = {data.speeds_mm_s.begin(), data.speeds_mm_s.end()};
  message->set_missed_contacts(Unsigned(data.missed_contacts));
}

}  // namespace

v1::DataReport ToMessage(const DataReport& data) {
  v1::DataReport message;
  message.set_kind(ToMessage(data.kind));
  message.set_unit(UnitOf(data.kind));
  message.set_session(data.session);
  message.set_emulated(data.emulated > 0);
  message.set_count(Unsigned(data.count));
  WriteSetAside(data.set_aside, message.mutable_set_aside());
  message.set_needed(Unsigned(data.needed));
  WriteErrors(data, &message);
  WriteWhere(data, &message);
  if (data.unexplained) WriteUnexplained(*data.unexplained, message.mutable_unexplained());
  for (const Candidate& candidate : data.candidates) WriteCandidate(candidate, message.add_candidates());
  WriteSet(data, message.mutable_set());
  for (const Curve& curve : data.curves) WriteCovariateCurve(curve, message.add_curves());
  WriteTouches(data, &message);
  if (data.photographs) WritePhotographs(*data.photographs, message.mutable_photographs());
  if (data.lens) WriteLens(*data.lens, message.mutable_lens());
  if (data.distributions) WriteDistributions(*data.distributions, message.mutable_distributions());
  return message;
}

}  // namespace touchstone::diagnosis::report
