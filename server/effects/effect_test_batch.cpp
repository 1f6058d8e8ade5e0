#include "server/effects/effect_test_batch.h"

#include <cmath>
#include <cstring>

#include "server/base/check.h"
#include "server/base/numbers/random.h"
#include "server/effects/all_effects.h"
#include "server/geometry/surface/surface.h"

namespace touchstone::effects {
namespace {

Eigen::Vector3d RandomDirection(RandomStream* random) {
  const Eigen::Vector3d direction(random->Normal(), random->Normal(), random->Normal());
  return direction.normalized();
}

bool Same(double a, double b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}
bool Same(int a, int b) {
  return a == b;
}
bool Same(uint64_t a, uint64_t b) {
  return a == b;
}
template <int rows, int columns>
bool Same(const Eigen::Matrix<double, rows, columns>& a, const Eigen::Matrix<double, rows, columns>& b) {
  for (int i = 0; i < a.size(); ++i)
    if (!Same(a.data()[i], b.data()[i])) return false;
  return true;
}
template <typename T>
bool Same(const std::vector<T>& a, const std::vector<T>& b) {
  if (a.size() != b.size()) return false;
  for (size_t i = 0; i < a.size(); ++i)
    if (!Same(a[i], b[i])) return false;
  return true;
}

}  // namespace

std::shared_ptr<const geometry::Surface> TestCube() {
  static const std::shared_ptr<const geometry::Surface> cube = [] {
    geometry::TriangleMesh mesh;
    for (const float z : {-0.05f, 0.05f})
      for (const float y : {-0.05f, 0.05f})
        for (const float x : {-0.05f, 0.05f}) mesh.vertices_m.emplace_back(x, y, z);
    mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                      {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    absl::StatusOr<std::shared_ptr<const geometry::Surface>> made =
        geometry::Surface::Create("cube", std::move(mesh));
    TOUCHSTONE_CHECK(made.ok());
    return *std::move(made);
  }();
  return cube;
}

TouchBatch TestBatch(int size, int fingers, uint64_t seed, bool all_hit) {
  TouchBatch b;
  b.Reset(size, fingers);
  b.surface = TestCube();
  b.seed = seed;
  b.spacing_m = 0.030;
  for (int touch = 0; touch < size; ++touch) {
    RandomStream random(seed, RandomDomain::kTest, touch);
    b.index[touch] = 100 + touch;
    b.target_m[touch] = 0.01 * RandomDirection(&random);
    b.approach[touch] = RandomDirection(&random);
    b.lateral[touch] = b.approach[touch].unitOrthogonal();
    b.standoff_m[touch] = random.Uniform(0.1, 0.2);
    b.speed_m_s[touch] = random.Uniform(0.01, 0.04);
    b.session_time_s[touch] = random.Uniform(0, 7200);
    b.pause_s[touch] = 7 + 0.001 * touch;
    double first_s = 1e9;
    double last_s = 0;
    for (int finger = 0; finger < fingers; ++finger) {
      const int entry = b.At(finger, touch);
      b.previous_press_m[entry] = random.Uniform(0, 0.005);
      b.travel_m[entry] = random.Uniform(0.05, 0.1);
      // A normal between head-on and 60 deg.
      b.cos_incidence[entry] = random.Uniform(0.5, 1);
      const double sine = std::sqrt(1 - b.cos_incidence[entry] * b.cos_incidence[entry]);
      b.normal[entry] = -b.cos_incidence[entry] * b.approach[touch] + sine * b.lateral[touch];
      b.contact_m[entry] = Eigen::Vector3d(random.Uniform(-0.05, 0.05), random.Uniform(-0.05, 0.05), 0.05);
      b.curvature_per_m[entry] = random.Uniform(0, 20);
      b.contact_time_s[entry] = b.travel_m[entry] / b.speed_m_s[touch];
      b.time_per_travel_s_m[entry] = 1 / b.speed_m_s[touch];
      if (!all_hit && random.Below(4) == 0) {
        b.travel_m[entry] = b.contact_time_s[entry] = NAN;
        b.contact_m[entry].setConstant(NAN);
        b.normal[entry].setZero();
      }
      b.reported_time_s[entry] = b.contact_time_s[entry];
      if (b.contact_time_s[entry] < first_s)
        first_s = b.contact_time_s[entry], b.first_finger[touch] = finger;
      if (b.contact_time_s[entry] > last_s) last_s = b.contact_time_s[entry];
    }
    for (int finger = 0; finger < fingers; ++finger) {
      const int entry = b.At(finger, touch);
      b.press_m[entry] = (last_s - b.contact_time_s[entry]) * b.speed_m_s[touch];
    }
  }
  return b;
}

void ApplyByName(const std::string& name, const FileValues& values, TouchBatch* touches) {
  const std::shared_ptr<const model::Effect> effect = Catalogue().Find(name);
  TOUCHSTONE_CHECK(effect != nullptr);
  ApplyEffect(*effect, values, touches);
}

void ApplyEffect(const model::Effect& effect, const FileValues& values, TouchBatch* touches) {
  std::vector<double> flat;
  size_t used = 0;
  for (const model::ParameterInfo& parameter : effect.parameters) {
    std::vector<double> own(parameter.Count(touches->fingers()), parameter.neutral);
    for (const auto& [name, given] : values)
      if (name == parameter.name) own = given, ++used;
    TOUCHSTONE_CHECK(static_cast<int>(own.size()) == parameter.Count(touches->fingers()));
    for (const double value : own) {
      TOUCHSTONE_CHECK(value >= parameter.lower && value <= parameter.upper);
      flat.push_back(ToSi(parameter.unit, value));
    }
  }
  TOUCHSTONE_CHECK(used == values.size());
  effect.apply(flat, *touches);
}

std::vector<std::string> ChangedFields(const TouchBatch& a, const TouchBatch& b) {
  std::vector<std::string> changed;
#define TOUCHSTONE_COMPARE(field) \
  if (!Same(a.field, b.field)) changed.push_back(#field);
  TOUCHSTONE_COMPARE(seed)
  TOUCHSTONE_COMPARE(index)
  TOUCHSTONE_COMPARE(target_m)
  TOUCHSTONE_COMPARE(approach)
  TOUCHSTONE_COMPARE(lateral)
  TOUCHSTONE_COMPARE(standoff_m)
  TOUCHSTONE_COMPARE(speed_m_s)
  TOUCHSTONE_COMPARE(session_time_s)
  TOUCHSTONE_COMPARE(pause_s)
  TOUCHSTONE_COMPARE(previous_press_m)
  TOUCHSTONE_COMPARE(spacing_m)
  TOUCHSTONE_COMPARE(stroke_m)
  TOUCHSTONE_COMPARE(travel_offset_m)
  TOUCHSTONE_COMPARE(tip_displacement_m)
  TOUCHSTONE_COMPARE(surface_scale)
  TOUCHSTONE_COMPARE(surface_rotation)
  TOUCHSTONE_COMPARE(surface_translation_m)
  TOUCHSTONE_COMPARE(tip_radius_m)
  TOUCHSTONE_COMPARE(travel_m)
  TOUCHSTONE_COMPARE(normal)
  TOUCHSTONE_COMPARE(contact_m)
  TOUCHSTONE_COMPARE(cos_incidence)
  TOUCHSTONE_COMPARE(curvature_per_m)
  TOUCHSTONE_COMPARE(speed_factor)
  TOUCHSTONE_COMPARE(acceleration_m_s2)
  TOUCHSTONE_COMPARE(slowdown_fraction)
  TOUCHSTONE_COMPARE(first_finger)
  TOUCHSTONE_COMPARE(contact_time_s)
  TOUCHSTONE_COMPARE(time_per_travel_s_m)
  TOUCHSTONE_COMPARE(press_m)
  TOUCHSTONE_COMPARE(reported_time_s)
  TOUCHSTONE_COMPARE(noise_sigma_s)
  TOUCHSTONE_COMPARE(noise_growth)
  TOUCHSTONE_COMPARE(any_noise)
  TOUCHSTONE_COMPARE(degrees_of_freedom)
  TOUCHSTONE_COMPARE(clock_factor)
  TOUCHSTONE_COMPARE(poll_interval_s)
  TOUCHSTONE_COMPARE(missed_probability)
  TOUCHSTONE_COMPARE(wander_sigma_s)
  TOUCHSTONE_COMPARE(wander_time_s)
#undef TOUCHSTONE_COMPARE
  if (a.formula_error != b.formula_error) changed.push_back("formula_error");
  if (a.surface != b.surface) changed.push_back("surface");
  return changed;
}

}  // namespace touchstone::effects
