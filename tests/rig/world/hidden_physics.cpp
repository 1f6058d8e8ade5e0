#include "tests/rig/world/hidden_physics.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "server/geometry/shapes/supershape.h"
#include "tests/hidden_effects/generator/unlisted.h"
#include "tests/rig/world/hidden_camera.h"

namespace touchstone::rig {
namespace {

constexpr int kAFinger = -1;
struct Row {
  const char* effect;
  const char* parameter;
  int count;       // of values; kAFinger: one a finger
  int place;       // of the first among the effect's
  double neutral;  // what stands there if it is not given
};
constexpr Row kRows[] = {
    {"tool_yaw", "angle_deg", 1, 0, 0},
    {"tool_tilt", "angle_deg", 1, 0, 0},
    {"finger_spacing", "delta_mm", 1, 0, 0},
    {"finger_length", "offset_mm", kAFinger, 0, 0},
    {"gravity_sag", "drop_mm", 1, 0, 0},
    {"object_scale", "relative", 1, 0, 0},
    {"object_pose", "translation_mm", 3, 0, 0},
    {"object_pose", "rotation_deg", 3, 3, 0},
    {"tip_radius", "radius_mm", 1, 0, 0},
    {"surface_error", "rms_mm", 1, 0, 0},
    {"surface_error", "length_mm", 1, 1, 20},
    {"speed_error", "relative", 1, 0, 0},
    {"acceleration_ramp", "acceleration_mm_s2", 1, 0, 1e6},
    {"contact_slowdown", "fraction", 1, 0, 0},
    {"object_push", "shift_mm", 1, 0, 0},
    {"oblique_slip", "travel_mm", 1, 0, 0},
    {"channel_latency", "latency_us", kAFinger, 0, 0},
    {"thermal_drift", "rate_mm_per_h", kAFinger, 0, 0},
    {"return_hysteresis", "fraction", 1, 0, 0},
    {"clock_skew", "relative", 1, 0, 0},
    {"poll_interval", "interval_us", 1, 0, 0},
    {"gaussian_noise", "sigma_us", 1, 0, 0},
    {"incidence_noise", "slope", 1, 0, 0},
    {"heavy_tail_noise", "degrees_of_freedom", 1, 0, 1000},
    {"missed_contact", "probability", 1, 0, 0},
};

std::vector<double> Numbers(const std::string& text, const std::string& whole) {
  std::vector<double> numbers;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t comma = std::min(text.find(',', begin), text.size());
    const std::string word = text.substr(begin, comma - begin);
    size_t used = 0;
    double value = NAN;
    try {
      value = std::stod(word, &used);
    } catch (const std::exception&) {
    }
    if (word.empty() || used != word.size() || !std::isfinite(value))
      throw std::invalid_argument("'" + whole + "': '" + word + "' is no number");
    numbers.push_back(value);
    begin = comma + 1;
  }
  return numbers;
}

// "NAME=VALUE", split.
std::pair<std::string, std::string> Split(const std::string& assignment, const char* form) {
  const size_t equals = assignment.find('=');
  if (equals == std::string::npos || equals == 0)
    throw std::invalid_argument("'" + assignment + "' must look like " + form);
  return {assignment.substr(0, equals), assignment.substr(equals + 1)};
}

}  // namespace

void Hide(const std::string& assignment, hidden::Scenario* scenario) {
  const auto [name, text] = Split(assignment, "EFFECT.PARAMETER=VALUE, as in tip_radius.radius_mm=2");
  const size_t first = name.find('.'), last = name.rfind('.');
  const std::string effect = name.substr(0, first);
  const std::string parameter = last == std::string::npos ? "" : name.substr(last + 1);
  const std::string object = first < last ? name.substr(first + 1, last - first - 1) : "";

  const Row* row = nullptr;
  std::string known;
  for (const Row& each : kRows) {
    if (effect == each.effect && parameter == each.parameter) row = &each;
    if (effect == each.effect) known += (known.empty() ? "" : ", ") + effect + "." + each.parameter;
  }
  if (row == nullptr) {
    if (known.empty()) {
      for (const Row& each : kRows)
        known += (known.empty() ? "" : ", ") + std::string(each.effect) + "." + each.parameter;
      known += ", and in the camera " + HiddenCameraNames();
    }
    throw std::invalid_argument("'" + name + "' cannot be hidden; there are " + known);
  }
  const int count = row->count == kAFinger ? scenario->fingers : row->count;
  const std::vector<double> values = Numbers(text, assignment);
  if (static_cast<int>(values.size()) != count)
    throw std::invalid_argument("'" + assignment + "': " + std::to_string(values.size()) +
                                " numbers, must be " + std::to_string(count));

  // The effect's numbers as far as they are known, else those that change nothing.
  const int objects = scenario->objects.size(), all = hidden::ValueCount(effect, scenario->fingers);
  auto found = std::find_if(scenario->hidden.begin(), scenario->hidden.end(),
                            [&](const hidden::Hidden& hidden) { return hidden.effect == effect; });
  if (found == scenario->hidden.end()) {
    hidden::Hidden hidden{effect, std::vector<double>(all, 0)};
    for (const Row& each : kRows)
      if (effect == each.effect && each.count == 1) hidden.values[each.place] = each.neutral;
    if (effect == "object_pose")
      for (int k = 1; k < objects; ++k)
        for (int j = 0; j < all; ++j) hidden.values.push_back(0);
    scenario->hidden.push_back(std::move(hidden));
    found = scenario->hidden.end() - 1;
  }
  bool named = object.empty();
  const int blocks = effect == "object_pose" ? objects : 1;
  for (int k = 0; k < blocks; ++k) {
    if (!object.empty() && (effect != "object_pose" || scenario->objects[k]->name() != object)) continue;
    named = true;
    std::copy(values.begin(), values.end(), found->values.begin() + k * all + row->place);
  }
  if (!named)
    throw std::invalid_argument("'" + assignment +
                                "': only object_pose may differ by object, and there is no object '" +
                                object + "'");
}

void AddUnlisted(const std::string& assignment, hidden::Scenario* scenario) {
  const auto [name, text] = Split(assignment, "NAME=K_MM or NAME=K_MM,SECOND, as in lead_screw=0.3,4");
  std::string known;
  bool found = false;
  for (const auto& kind : hidden::UnlistedKinds()) {
    known += (known.empty() ? "" : ", ") + std::string(kind.name);
    found = found || name == kind.name;
  }
  if (!found) throw std::invalid_argument("no unlisted effect is called '" + name + "'; there are " + known);
  const std::vector<double> values = Numbers(text, assignment);
  if (values.size() > 2) throw std::invalid_argument("'" + assignment + "': at most two numbers");
  scenario->unlisted.push_back({name, values[0], values.size() > 1 ? values[1] : 0});
}

std::vector<std::shared_ptr<const hidden::Solid>> ReadObjects(const std::vector<std::string>& meshes,
                                                              int triangles) {
  std::vector<std::shared_ptr<const hidden::Solid>> objects;
  for (const std::string& mesh : meshes) {
    const auto [name, file] = Split(mesh, "NAME=FILE");
    objects.push_back(std::make_shared<hidden::Solid>(name, hidden::ReadTriangles(file)));
  }
  if (meshes.empty())
    for (const std::string& name : geometry::SupershapeNames())
      objects.push_back(std::make_shared<hidden::Solid>(name, hidden::SupershapeTriangles(name, triangles)));
  return objects;
}

}  // namespace touchstone::rig
