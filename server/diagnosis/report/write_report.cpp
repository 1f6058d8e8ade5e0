#include "server/diagnosis/report/write_report.h"

#include "server/base/units.h"
#include "server/diagnosis/report/design_messages.h"
#include "server/diagnosis/report/distributions_messages.h"
#include "server/diagnosis/report/message_parts.h"
#include "server/diagnosis/report/residuals_messages.h"
#include "server/effects/formula.h"
#include "server/model/finger_name.h"

namespace touchstone::diagnosis::report {
namespace {

void WriteQuality(const engine::Quality& quality, v1::Quality* message) {
  message->set_rmse_us(Microseconds(quality.rmse));
  message->set_heldout_rmse_us(Microseconds(quality.heldout_rmse));
  message->set_lack_of_fit_p(quality.lack_of_fit_p);
}

void WriteNoiseFloor(const engine::NoiseFloor& floor, v1::NoiseFloor* message) {
  message->set_sigma_us(Microseconds(floor.sigma));
  message->set_lower_us(Microseconds(floor.lower));
  message->set_upper_us(Microseconds(floor.upper));
  message->set_degrees_of_freedom(static_cast<uint32_t>(floor.degrees_of_freedom));
  message->set_from_repeats(floor.from_repeats);
}

void WriteStep(const engine::LadderStep& step, v1::Step* message) {
  WriteStepWithoutErrors(step, message);
  message->set_rmse_us(Microseconds(step.quality.rmse));
  message->set_heldout_rmse_us(Microseconds(step.quality.heldout_rmse));
}

void WriteCandidate(const engine::RankedCandidate& candidate, v1::Candidate* message) {
  WriteCandidateWithoutErrors(candidate, message);
  message->set_rmse_us(Microseconds(candidate.rmse));
  message->set_heldout_rmse_us(Microseconds(candidate.heldout_rmse));
}

void WriteCurve(const model::LookupSpec& lookup, v1::UnexplainedCurve* message) {
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

void WriteUnexplained(const engine::UnexplainedRest& rest, v1::Unexplained* message) {
  WriteRestWithoutErrors(rest, message);
  WriteParameters(rest.parameters, message);
  message->set_rmse_us(Microseconds(rest.rmse));
  message->set_heldout_rmse_us(Microseconds(rest.heldout_rmse));
  message->set_nearest_effect(rest.nearest_effect);
  message->set_nearest_cosine(rest.nearest_cosine);
  message->set_nearest_formula(rest.nearest_formula);
  message->set_nearest_formula_share(rest.nearest_formula_share);
  if (rest.lookup != nullptr) WriteCurve(*rest.lookup->lookup, message->mutable_curve());
}

void WriteDataProblem(const engine::DataProblem& problem, v1::DataProblem* message) {
  WriteProblemWithoutErrors(problem, message);
  message->set_rmse_before_us(Microseconds(problem.error_before));
  message->set_rmse_after_us(Microseconds(problem.error_after));
}

void WriteData(const touches::DataSummary& data, v1::Report* report) {
  report->set_touches(static_cast<uint32_t>(data.touches));
  for (int finger = 0; finger < data.fingers; ++finger)
    report->add_fingers(model::FingerName(finger, data.fingers));
  v1::DataSummary* message = report->mutable_data();
  message->set_origin(data.origin);
  message->set_rows(static_cast<uint32_t>(data.rows));
  for (const auto& [reason, unused] : data.unused) {
    v1::UnusedRows* rows = message->add_unused();
    rows->set_reason(reason);
    rows->set_rows(static_cast<uint32_t>(unused.count));
    for (const uint64_t touch : unused.examples) rows->add_examples(touch);
  }
  message->set_outliers(static_cast<uint32_t>(data.outliers));
  for (const std::string& object : data.objects) message->add_objects(object);
  message->set_poses(static_cast<uint32_t>(data.poses));
  message->set_repeats(static_cast<uint32_t>(data.repeats));
  message->set_rounds(static_cast<uint32_t>(data.rounds));
  for (const double speed_mm_s : data.speeds_mm_s) message->add_speeds_mm_s(speed_mm_s);
  message->set_missed_contacts(static_cast<uint32_t>(data.missed_contacts));
}

void WriteCauses(const Diagnosis& diagnosis, v1::Report* report) {
  WriteModelChanges(diagnosis, report);
  for (const engine::LadderStep& step : diagnosis.steps) WriteStep(step, report->add_steps());
  for (const engine::RankedCandidate& candidate : diagnosis.candidates)
    WriteCandidate(candidate, report->add_candidates());
  if (diagnosis.unexplained) WriteUnexplained(*diagnosis.unexplained, report->mutable_unexplained());
}

}  // namespace

v1::Report ToReport(const Diagnosis& diagnosis) {
  if (diagnosis.pose_free) return PoseFreeReport(diagnosis.pose_free->input, diagnosis.pose_free->comparison);
  v1::Report report;
  report.set_verdict(ToMessage(diagnosis.verdict));
  report.set_model_name(diagnosis.model_name);
  report.set_model_hash(diagnosis.model_hash);
  WriteData(diagnosis.data, &report);
  if (diagnosis.noise_floor) {
    WriteNoiseFloor(*diagnosis.noise_floor, report.mutable_noise_floor());
    report.set_noise_floor_us(report.noise_floor().sigma_us());
  }
  if (diagnosis.initial) WriteQuality(*diagnosis.initial, report.mutable_initial());
  if (diagnosis.final) WriteQuality(*diagnosis.final, report.mutable_final());
  report.set_reducible_share(diagnosis.reducible_share);
  WriteResiduals(diagnosis.residuals, diagnosis.data.fingers, &report);
  WriteCauses(diagnosis, &report);
  for (const engine::DataProblem& problem : diagnosis.data_problems)
    WriteDataProblem(problem, report.add_data_problems());
  report.set_touches_needed(static_cast<uint32_t>(diagnosis.touches_needed));
  for (const design::ProposedTouch& touch : diagnosis.next_touches) WriteProposedTouch(touch, &report);
  report.set_summary(diagnosis.summary);
  for (const std::string& warning : diagnosis.warnings) report.add_warnings(warning);
  report.set_duration_s(diagnosis.duration_s);
  return report;
}

}  // namespace touchstone::diagnosis::report
