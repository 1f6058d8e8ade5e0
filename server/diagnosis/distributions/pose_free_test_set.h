// For tests: sets without poses that a model made on a wedge.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/diagnosis/distributions/assumed_plan.h"
#include "server/diagnosis/distributions/planned_touches.h"
#include "server/diagnosis/input.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::distributions {

// A wedge of 120 x 100 x 80 mm: six faces, none of them like another.
inline std::shared_ptr<const geometry::Surface> WedgeSurface() {
  geometry::TriangleMesh mesh;
  mesh.vertices_m = {{-0.06f, -0.05f, -0.04f}, {0.06f, -0.05f, -0.04f}, {0.06f, 0.05f, -0.04f},
                     {-0.06f, 0.05f, -0.04f},  {-0.05f, -0.04f, 0.03f}, {0.05f, -0.05f, 0.04f},
                     {0.055f, 0.045f, 0.02f},  {-0.06f, 0.05f, 0.04f}};
  for (const auto& q : std::vector<std::array<uint32_t, 4>>{
           {3, 2, 1, 0}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}}) {
    mesh.triangles.push_back({q[0], q[1], q[2]});
    mesh.triangles.push_back({q[0], q[2], q[3]});
  }
  return *geometry::Surface::Create("wedge", mesh);
}

inline std::shared_ptr<const model::Model> WedgeModel(const std::string& effects) {
  auto model =
      model::ParseModel("touchstone: model/1\nname: nominal\nend_effector: {fingers: 3, spacing_mm: 30}\n" +
                            (effects.empty() ? effects : "effects:\n" + effects),
                        "test", effects::Catalogue());
  EXPECT_TRUE(model.ok()) << model.status();
  return std::make_shared<const model::Model>(*std::move(model));
}

inline constexpr char kWedgeNoise[] = "  - gaussian_noise: {sigma_us: 5000}\n";

// A set without poses that `model` made: `poses` x `rounds` on each object, in rounds.
inline DiagnosisInput MakePoseFreeInput(const std::shared_ptr<const model::Model>& model, int poses_a_face,
                                        int rounds, uint64_t seed, const std::string& nominal = kWedgeNoise,
                                        int objects = 1, const AssumedPoses& poses = {}) {
  auto set = std::make_shared<session::MeasurementSet>();
  set->origin = "test.csv";
  set->fingers = 3;
  DiagnosisInput input;
  for (int o = 0; o < objects; ++o) {
    set->objects.push_back("wedge" + std::to_string(o));
    input.surfaces[set->objects[o]] = WedgeSurface();
    touch::Plan plan;
    plan.kind = touch::Plan::Kind::kFaces;
    plan.faces.samples_per_face = poses_a_face;
    plan.faces.rounds = rounds;
    plan.touch_interval_s = 10;
    std::vector<uint64_t> numbers(6 * poses_a_face * rounds);
    for (size_t n = 0; n < numbers.size(); ++n) numbers[n] = n;
    const auto time_s =
        *SimulatePlan(model, WedgeSurface(), WithPoses(plan, poses), numbers, 1000003 * seed + o + 77);
    for (size_t n = 0; n < numbers.size(); ++n) {
      set->touch.push_back(set->touch.size());
      set->object.push_back(o);
    }
    set->time_s.insert(set->time_s.end(), time_s.begin(), time_s.end());
  }
  input.set = set;
  input.model = WedgeModel(nominal);
  return input;
}

}  // namespace touchstone::diagnosis::distributions
