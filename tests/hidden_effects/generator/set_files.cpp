#include "tests/hidden_effects/generator/set_files.h"

#include <cmath>
#include <cstdio>
#include <map>

namespace touchstone::hidden {
namespace {

std::string Number(double value) {
  char text[32];
  snprintf(text, sizeof text, "%.10g", value);
  return text;
}

std::string FingerColumn(int finger, int fingers) {
  return fingers == 3 ? std::string(1, "lmr"[finger]) : std::to_string(finger);
}

}  // namespace

std::string Csv(const Scenario& scenario, const Protocol& protocol, const std::vector<double>& reported_us) {
  const int fingers = scenario.fingers;
  std::string csv;
  if (scenario.with_poses) {
    csv = "touch,object,round,face,session_time_s,speed_mm_s,standoff_mm";
    for (const char* vector : {"target_%c_mm", "approach_%c", "lateral_%c"})
      for (const char axis : {'x', 'y', 'z'}) {
        char name[32];
        snprintf(name, sizeof name, vector, axis);
        csv += std::string(",") + name;
      }
    if (scenario.with_temperature) csv += ",cov_temperature";
  } else {
    csv = "object";
  }
  for (int i = 0; i < fingers; ++i) csv += ",t_" + FingerColumn(i, fingers) + "_us";
  csv += '\n';
  for (size_t k = 0; k < protocol.commands.size(); ++k) {
    const Command& command = protocol.commands[k];
    const std::string& object = scenario.objects[command.object]->name();
    if (scenario.with_poses) {
      csv += std::to_string(k) + ',' + object + ',' + std::to_string(command.round) + ',' +
             std::to_string(command.face) + ',' + Number(protocol.session_time_s[k]) + ',' +
             Number(protocol.speed_mm_s[k]) + ',' +
             Number(command.standoff_mm > 0 ? command.standoff_mm : scenario.standoff_mm);
      for (const Eigen::Vector3d* vector : {&command.target_mm, &command.approach, &command.lateral})
        for (int axis = 0; axis < 3; ++axis) csv += ',' + Number((*vector)[axis]);
      if (scenario.with_temperature) csv += ',' + Number(protocol.temperature[k]);
    } else {
      csv += object;
    }
    // Relative to the first that reports, whole microseconds.
    double first_us = 1e300;
    for (int i = 0; i < fingers; ++i)
      if (reported_us[k * fingers + i] < first_us) first_us = reported_us[k * fingers + i];
    for (int i = 0; i < fingers; ++i) {
      const double time_us = reported_us[k * fingers + i];
      csv += ',';
      if (time_us == time_us) csv += std::to_string(std::llround(time_us - first_us));
    }
    csv += '\n';
  }
  return csv;
}

std::string NominalYaml(const Scenario& scenario) {
  static const std::map<std::string, std::string> kNames = {{"tip_radius", "radius_mm"},
                                                            {"oblique_slip", "travel_mm"},
                                                            {"object_push", "shift_mm"},
                                                            {"finger_spacing", "delta_mm"},
                                                            {"tool_tilt", "angle_deg"},
                                                            {"tool_yaw", "angle_deg"},
                                                            {"return_hysteresis", "fraction"},
                                                            {"speed_error", "relative"},
                                                            {"gravity_sag", "drop_mm"},
                                                            {"object_scale", "relative"},
                                                            {"finger_length", "offset_mm"},
                                                            {"poll_interval", "interval_us"},
                                                            {"heavy_tail_noise", "degrees_of_freedom"}};
  std::string yaml =
      "touchstone: model/1\nname: nominal\nend_effector: {fingers: " + std::to_string(scenario.fingers) +
      ", spacing_mm: " + Number(scenario.spacing_mm) + "}\n";
  if (scenario.noise_in_model || !scenario.in_model.empty()) yaml += "effects:\n";
  for (const Hidden& hidden : scenario.in_model) {
    std::string values;
    for (const double value : hidden.values) values += (values.empty() ? "" : ", ") + Number(value);
    if (ValueCount(hidden.effect, 2) > 1) values = "[" + values + "]";
    yaml += "  - " + hidden.effect + ": {" + kNames.at(hidden.effect) + ": " + values + "}\n";
  }
  const double claimed_us = scenario.model_sigma_us > 0 ? scenario.model_sigma_us : scenario.sigma_us;
  if (scenario.noise_in_model) yaml += "  - gaussian_noise: {sigma_us: " + Number(claimed_us) + "}\n";
  return yaml;
}

}  // namespace touchstone::hidden
