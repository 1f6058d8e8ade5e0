#include "client/report/sample_reports.h"

#include <absl/strings/str_cat.h>

#include "client/report/sample_evidence.h"
#include "server/base/numbers/normal.h"

namespace touchstone::client {
namespace {

void SetQuality(double rmse_us, double heldout_us, double p, v1::Quality* quality) {
  quality->set_rmse(rmse_us);
  quality->set_heldout_rmse(heldout_us);
  quality->set_lack_of_fit_p(p);
}

template <typename Owner>
v1::ParameterValue* AddParameter(const char* name, const char* unit, double value, double error,
                                 Owner* owner) {
  v1::ParameterValue* parameter = owner->add_parameters();
  parameter->set_name(name);
  parameter->set_unit(unit);
  parameter->set_value(value);
  parameter->set_std_error(error);
  parameter->set_lower(value - kNormalQuantile975 * error);
  parameter->set_upper(value + kNormalQuantile975 * error);
  return parameter;
}

v1::Candidate* AddCandidate(const char* effect, double probability, double rmse_us, double gain,
                            v1::Report* report) {
  v1::Candidate* candidate = report->mutable_data(0)->add_candidates();
  candidate->set_effect(effect);
  candidate->set_probability(probability);
  candidate->set_rmse(rmse_us);
  candidate->set_heldout_rmse(rmse_us * 1.004);
  candidate->set_gain_nats(gain);
  candidate->mutable_scope()->set_kind(v1::Scope::RIG);
  return candidate;
}

void AddSlice(const char* slice, uint32_t touches, double mean_us, double share, const char* words,
              v1::Report* report) {
  v1::Slice* part = report->mutable_data(0)->add_where();
  part->set_slice(slice);
  part->set_count(touches);
  part->set_mean_residual(mean_us);
  part->set_share_of_excess_error(share);
  part->set_words(words);
  part->set_rmse(std::abs(mean_us) * 1.3);
}

// An entry of touches that says how wrong the model is.
v1::DataReport* AddTouches(uint32_t count, v1::Report* report) {
  v1::DataReport* data = report->add_data();
  data->set_kind(v1::DataReport::TOUCHES);
  data->set_unit("us");
  data->set_count(count);
  for (const char* finger : {"l", "m", "r"}) data->add_fingers(finger);
  return data;
}

// A further step, and the error after it.
v1::Step* AddStep(const char* effect, double rmse_us, double heldout_us, double p, v1::Report* report) {
  SetQuality(rmse_us, heldout_us, p, report->mutable_data(0)->add_after_step());
  v1::Step* step = report->add_steps();
  step->set_effect(effect);
  step->mutable_scope()->set_kind(v1::Scope::RIG);
  return step;
}

// What every report of a set with poses has.
v1::Report Base(double initial_us, double floor_us) {
  v1::Report report;
  v1::DataReport& data = *AddTouches(960, &report);
  data.set_session("measurements/lab-2026-03.csv");
  SetQuality(initial_us, initial_us * 1.002, initial_us > 1.1 * floor_us ? 0 : 0.41, data.mutable_initial());
  *data.mutable_final() = data.initial();
  data.set_reducible_share(std::max(0.0, 1 - floor_us * floor_us / initial_us / initial_us));
  for (double bias : {2100.0, -3900.0, 1800.0}) data.add_finger_bias(bias * initial_us / 41000);
  report.set_model_name("nominal");
  report.set_model_hash("7f1c09e3b2a84d55c0ffee00112233445566778899aabbccddeeff0011223344");
  report.set_version("0.2.0");
  report.set_duration_s(3.4);
  v1::DataSummary& set = *data.mutable_set();
  set.set_rows(1000);
  set.set_poses(240);
  set.set_rounds(4);
  set.set_repeats(720);
  set.add_speeds_mm_s(20);
  set.set_missed_contacts(7);
  for (const char* object : {"lat10", "lat20", "box_rounded"}) set.add_objects(object);
  data.mutable_set_aside()->set_count(40);
  v1::UnusedRows* edge = data.mutable_set_aside()->add_rows();
  edge->set_rows(33);
  edge->set_reason("a finger within 0.3 mm of an edge");
  for (int touch : {12, 77, 103, 240, 391, 402}) edge->add_examples(touch);
  v1::UnusedRows* lone = data.mutable_set_aside()->add_rows();
  lone->set_rows(7);
  lone->set_reason("fewer than two fingers reported");
  for (int touch : {8, 19}) lone->add_examples(touch);
  data.set_noise_floor(floor_us);
  v1::NoiseFloor& noise = *data.mutable_noise();
  noise.set_degrees_of_freedom(1440);
  noise.set_lower(floor_us * 0.964);
  noise.set_upper(floor_us * 1.038);
  noise.set_from_repeats(true);
  AddEvidence(initial_us, floor_us, &data);
  return report;
}

void AddModel(const char* text, v1::Report* report) {
  report->set_improved_model_yaml(text);
  report->set_improved_model_hash("3f9c2ad1b2a84d55c0ffee00112233445566778899aabbccddeeff0055667788");
}

}  // namespace

v1::Report MissingEffectsReport() {
  v1::Report report = Base(41000, 5003);
  report.set_verdict(v1::Report::MISSING_EFFECTS);
  report.set_summary(
      "The fingers end in balls, the model has points; and the left finger reports late. Both together "
      "bring the error down to what repeats of the same touch have among themselves.");
  AddSlice("incidence > 12 deg", 412, -9100, 0.71, "contact too early by 9.1 ms", &report);
  AddSlice("object = lat20 and face = side", 96, 6200, 0.18, "outer fingers too late by 6.2 ms", &report);
  AddSlice("curvature > 20 1/m and finger = m", 40, -850, 0.04, "contact too early by 850 us", &report);

  v1::Step* radius = AddStep("tip_radius", 7900, 7950, 3e-12, &report);
  radius->add_equivalent("surface_offset");
  radius->set_probability(0.994);
  AddParameter("radius_mm", "mm", 2.981, 0.021, radius);
  radius->set_gain_nats(2210);
  radius->set_meaning("The fingers end in balls; the model has points.");
  radius->set_remedy("Keep the radius in the model, or fit pointed tips.");
  radius->set_check_on_rig(
      "Measure the tips, or touch one flat face at 0 and 25 deg: only the second shifts.");
  radius->set_discriminating_measurement(
      "touches on the edge of a box: a ball rolls over it, an offset does not");
  v1::Step* latency = AddStep("channel_latency", 5010, 5030, 0.44, &report);
  latency->set_probability(0.97);
  for (const auto& [finger, value] :
       {std::pair<const char*, double>{"l", 8200}, {"m", -3900}, {"r", -4300}}) {
    AddParameter("latency_us", "us", value, 190, latency)->set_finger(finger);
  }
  latency->set_gain_nats(318);
  latency->set_meaning("One channel reports later than the others.");
  latency->set_remedy("Keep the latencies in the model, or poll the channels at once.");
  latency->set_check_on_rig("Swap the cables of two fingers: the delay moves with the channel.");
  SetQuality(5010, 5030, 0.44, report.mutable_data(0)->mutable_final());

  AddParameter("radius_mm", "mm", 2.975, 0.034, AddCandidate("tip_radius", 0.994, 7900, 2210, &report));
  AddParameter("travel_mm", "mm", 0.71, 0.031, AddCandidate("oblique_slip", 0.006, 12700, 1720, &report));
  AddParameter("relative", "", 0.0131, 0.0012, AddCandidate("object_scale", 1e-7, 29000, 940, &report));
  AddParameter("rms_mm", "mm", 0.31, 0.05, AddCandidate("surface_error", 1e-9, 31000, 610, &report));
  AddParameter("angle_deg", "deg", -0.42, 0.11, AddCandidate("tool_tilt", 1e-12, 38800, 120, &report));
  AddParameter("shift_mm", "mm", 0.004, 0.013, AddCandidate("object_push", 0, 40990, 0, &report));
  AddCandidate("speed_error", 0, 41000, 0, &report)
      ->set_note("this experiment cannot see it: one speed only");
  v1::Ambiguity* pair = report.add_ambiguities();
  pair->add_effects("channel_latency");
  pair->add_effects("finger_length");
  pair->set_discriminating_measurement(
      "the same touches at a second speed: a latency keeps its time, a length keeps its distance");
  AddModel(
      "touchstone: model/1\nname: nominal-improved\nend_effector: {fingers: 3, spacing_mm: 30}\neffects:\n"
      "  - tip_radius: {radius_mm: 2.981}\n  - channel_latency: {latency_us: [8200, -3900, -4300]}\n"
      "  - gaussian_noise: {sigma_us: 5010}\n",
      &report);
  AddProposals(24, "tells channel_latency from finger_length", &report);
  return report;
}

v1::Report WrongValuesReport() {
  v1::Report report = Base(9100, 812);
  report.set_verdict(v1::Report::WRONG_VALUES);
  report.set_summary(
      "No effect is missing. The slowdown after the first contact is stronger than the model says.");
  AddSlice("gap to the first finger > 40 ms", 310, 7700, 0.83, "later fingers too late by 7.7 ms", &report);
  v1::Refit* slowdown = report.add_refitted();
  slowdown->set_effect("contact_slowdown");
  AddParameter("fraction", "", 0.183, 0.0042, slowdown)->set_before(0.05);
  v1::Refit* noise = report.add_refitted();
  noise->set_effect("gaussian_noise");
  AddParameter("sigma_us", "us", 812, 12, noise)->set_before(2000);
  SetQuality(815, 818, 0.63, report.mutable_data(0)->mutable_final());
  v1::Ambiguity* pair = report.add_ambiguities();
  for (const char* effect : {"contact_slowdown", "speed_error", "clock_skew"}) pair->add_effects(effect);
  pair->set_discriminating_measurement(
      "the arm's encoders: only a speed error shows before the first contact");
  AddModel(
      "touchstone: model/1\nname: nominal-improved\neffects:\n  - contact_slowdown: {fraction: 0.183}\n"
      "  - gaussian_noise: {sigma_us: 812}\n",
      &report);
  return report;
}

v1::Report AdequateReport() {
  v1::Report report = Base(5100, 5100);
  report.set_verdict(v1::Report::ADEQUATE);
  report.set_summary("What is left between model and measurements is noise.");
  v1::DataReport& data = *report.mutable_data(0);
  data.mutable_noise()->set_from_repeats(false);
  data.mutable_set()->set_repeats(0);
  data.mutable_set()->set_rounds(1);
  data.clear_set_aside();
  data.mutable_set()->set_rows(960);
  report.add_warnings(
      "no touch was repeated, so the noise floor is an upper bound from the model's own residuals");
  AddParameter("radius_mm", "mm", 0.02, 0.04, AddCandidate("tip_radius", 0.02, 5099, -2.1, &report));
  AddParameter("relative", "", 0.0004, 0.0005, AddCandidate("object_scale", 0.01, 5099.5, -2.9, &report));
  return report;
}

v1::Report UnexplainedReport() {
  v1::Report report = Base(23500, 5003);
  report.set_verdict(v1::Report::UNEXPLAINED);
  report.set_summary(
      "The rest swings with the travel, four millimetres a period; no built-in effect does that.");
  AddSlice("travel > 60 mm and finger = r", 201, 6100, 0.41, "contact too late by 6.1 ms", &report);
  v1::Unexplained& rest = *report.mutable_data(0)->mutable_unexplained();
  for (const auto& [name, p] :
       {std::pair<const char*, double>{"travel_mm", 1e-9}, {"previous_press_mm", 0.003}}) {
    v1::CovariateTest* test = rest.add_covariates();
    test->set_name(name);
    test->set_p(p);
    test->set_gain_nats(p < 1e-6 ? 410 : 6);
  }
  rest.set_formula("k * sin(2*pi*travel_mm/lead)");
  rest.set_formula_yaml(
      "- formula:\n    name: suggested\n    adds: travel_mm\n    expression: \"k * "
      "sin(2*pi*travel_mm/lead)\"\n"
      "    parameters: {k: {value: 0.44, unit: mm, min: -1, max: 1}, lead: {value: 4.01, unit: mm, min: 2, "
      "max: 10}}\n");
  AddParameter("k", "mm", 0.44, 0.012, &rest);
  AddParameter("lead", "mm", 4.01, 0.004, &rest);
  rest.set_rmse(6200);
  rest.set_heldout_rmse(6350);
  rest.set_heldout_gain(0.96);
  rest.set_nearest_effect("speed_error");
  rest.set_nearest_cosine(0.21);
  AddParameter("relative", "", 0.011, 0.004, AddCandidate("speed_error", 0.2, 23300, 3.1, &report));
  return report;
}

v1::Report CheckDataReport() {
  v1::Report report = Base(865613, 5103);
  report.set_verdict(v1::Report::CHECK_DATA);
  report.mutable_data(0)->clear_where();
  v1::DataProblem* problem = report.add_data_problems();
  problem->set_kind(v1::DataProblem::LATERAL_REVERSED);
  problem->set_detail("lateral -> -lateral");
  problem->set_words(
      "It looks as if the lateral vectors point from the last finger to the first. With that fixed, the "
      "model as it "
      "is would be "
      "off by 14.4 ms instead of 866 ms.");
  problem->set_fix("touchstone session fix measurements/lab-2026-03.csv --reverse-lateral -o fixed.csv");
  problem->set_error_before(865613);
  problem->set_error_after(14433);
  v1::DataProblem* other = report.add_data_problems();
  other->set_kind(v1::DataProblem::FINGER_ORDER);
  other->set_detail("l <-> r");
  other->set_words(
      "These data cannot tell it from another mistake: the time columns of the fingers l and r are "
      "exchanged. With that fixed, "
      "the model as it is would be off by 14.4 ms instead of 866 ms.");
  other->set_fix("touchstone session fix measurements/lab-2026-03.csv --swap-fingers l,r -o fixed.csv");
  other->set_error_before(865613);
  other->set_error_after(14433);
  return report;
}

v1::Report TooLittleDataReport() {
  v1::Report report;
  report.set_verdict(v1::Report::TOO_LITTLE_DATA);
  v1::DataReport& data = *AddTouches(6, &report);
  data.set_needed(16);
  data.set_session("measurements/first-six.csv");
  SetQuality(25400, 25400, 1, data.mutable_initial());
  *data.mutable_final() = data.initial();
  report.set_model_name("nominal");
  report.set_summary("The model is off by 25.4 ms. That is too little for a verdict; 16 touches would do.");
  v1::DataSummary& set = *data.mutable_set();
  set.set_rows(6);
  set.set_poses(6);
  set.add_speeds_mm_s(20);
  set.add_objects("lat10");
  report.add_warnings("Only 6 touches took part: weak effects stay unseen, and errors are rough.");
  return report;
}

v1::Report CompareReport() {
  v1::Report report = Base(41000, 5003);
  AddSlice("incidence > 12 deg", 412, -9100, 0.71, "contact too early by 9.1 ms", &report);
  return report;
}

v1::Report WithoutPosesReport() {
  v1::Report report;
  v1::DataReport& data = *AddTouches(800, &report);
  data.set_kind(v1::DataReport::DISTRIBUTIONS);
  report.set_model_name("nominal");
  data.mutable_set()->set_rows(800);
  data.mutable_set()->add_objects("cross");
  data.mutable_set()->add_objects("star");
  v1::DistributionComparison& comparison = *data.mutable_distributions();
  comparison.set_energy_distance(0.213);
  comparison.set_p(0.0005);
  comparison.set_simulated_touches(8000);
  comparison.set_plan("faces, 6 x 40, speed 20 mm/s");
  for (const auto& [name, measured, simulated, unit, p] :
       {std::tuple<const char*, double, double, const char*, double>{"median gap", 41200, 38800, "us", 0.002},
        {"90 % gap", 188000, 190500, "us", 0.31},
        {"mean curvature", 4.1, 2.2, "1/m", 0.0004}}) {
    v1::StatisticTest* test = comparison.add_statistics();
    test->set_name(name);
    test->set_measured(measured);
    test->set_simulated(simulated);
    test->set_unit(unit);
    test->set_p(p);
  }
  for (const char* effect : {"gaussian_noise", "tip_radius"}) comparison.add_compatible_effects(effect);
  report.add_warnings("the set has no poses; two orders of magnitude weaker than touches with poses");
  AddHistograms(30000, &data);
  return report;
}

v1::Report JointReport() {
  v1::Report report = MissingEffectsReport();
  v1::DataReport& pictures = *report.add_data();
  pictures.set_kind(v1::DataReport::PHOTOGRAPHS);
  pictures.set_unit("grey");
  pictures.set_session("measurements/lab-2026-03");
  pictures.set_count(12);
  pictures.set_noise_floor(1.43);
  pictures.mutable_noise()->set_from_repeats(true);
  pictures.mutable_set()->set_repeats(2);
  pictures.set_reducible_share(0.94);
  SetQuality(6.03, 6.04, 0, pictures.mutable_initial());
  for (const double rmse : {2.2, 1.43}) SetQuality(rmse, rmse, 0.9, pictures.add_after_step());
  SetQuality(1.43, 1.43, 0.9, pictures.mutable_final());
  return report;
}

std::vector<NamedReport> AllSampleReports() {
  return {{"missing_effects", MissingEffectsReport()},
          {"wrong_values", WrongValuesReport()},
          {"adequate", AdequateReport()},
          {"unexplained", UnexplainedReport()},
          {"check_data", CheckDataReport()},
          {"too_little_data", TooLittleDataReport()},
          {"compare", CompareReport()},
          {"without_poses", WithoutPosesReport()},
          {"joint", JointReport()},
          {"empty", v1::Report()}};
}

}  // namespace touchstone::client
