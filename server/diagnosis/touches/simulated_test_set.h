// For tests: measurement sets that the simulator itself makes under a model with something hidden. (The
// independent generator is tests/hidden_effects/.)
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/diagnosis/input.h"
#include "server/effects/all_effects.h"
#include "server/geometry/shapes/supershape.h"
#include "server/touch/batch_row.h"
#include "server/touch/plan.h"
#include "server/touch/simulate.h"

namespace touchstone::diagnosis::touches {

struct HiddenRig {
  std::vector<std::string> objects = {"lat00", "lat10", "lat20"};
  int samples_per_face = 4;
  int rounds = 3;
  std::vector<double> speeds_mm_s;  // of one round after the other; empty: the plan's
  double sigma_us = 2000;
  // Effects of the rig that the model lacks: {"tip_radius", "radius_mm=1.5"}.
  std::vector<std::pair<std::string, std::vector<std::string>>> hidden;
  // Effects that the model has, as the model has them.
  std::vector<std::pair<std::string, std::vector<std::string>>> known;
  uint64_t seed = 1;
  uint64_t pose_seed = 0;  // of the poses alone; 0: seed
};

inline model::Model WithEffects(
    model::Model model, const std::vector<std::pair<std::string, std::vector<std::string>>>& effects) {
  for (const auto& [name, values] : effects) {
    absl::StatusOr<model::Model> more = model::AddEffect(model, name, values, effects::Catalogue());
    EXPECT_TRUE(more.ok()) << more.status();
    model = *std::move(more);
  }
  return model;
}

inline std::shared_ptr<const geometry::Surface> TestSurface(const std::string& name) {
  static std::map<std::string, std::shared_ptr<const geometry::Surface>> made;
  std::shared_ptr<const geometry::Surface>& surface = made[name];
  if (surface == nullptr)
    surface =
        *geometry::Surface::Create(name, *geometry::MakeSupershape(*geometry::NamedSupershape(name), 4000));
  return surface;
}

inline DiagnosisInput MakeTestInput(const HiddenRig& rig) {
  DiagnosisInput input;
  auto set = std::make_shared<session::MeasurementSet>();
  set->origin = "set.csv";
  set->fingers = 3;
  set->has_poses = set->has_session_time = true;
  const model::Model nominal =
      WithEffects(model::NominalModel(), {{"gaussian_noise", {"sigma_us=" + std::to_string(rig.sigma_us)}}});
  model::Model real = WithEffects(nominal, rig.hidden);
  const touch::TouchSimulator simulator(std::make_shared<const model::Model>(real));
  touch::Plan plan;
  plan.kind = touch::Plan::Kind::kFaces;
  plan.faces.samples_per_face = rig.samples_per_face;
  plan.faces.rounds = rig.rounds;
  plan.touch_interval_s = 9;
  std::vector<double> previous_press_m(3, 0.0);
  effects::TouchBatch batch;
  for (size_t object = 0; object < rig.objects.size(); ++object) {
    const auto surface = TestSurface(rig.objects[object]);
    input.surfaces[rig.objects[object]] = surface;
    set->objects.push_back(rig.objects[object]);
    const auto generator = touch::MakePoseGenerator(
        plan, surface->bounds(), (rig.pose_seed != 0 ? rig.pose_seed : rig.seed) + 17 * object);
    touch::TouchWorkspace workspace;
    for (uint64_t number = 0; number < generator->Count(); ++number) {
      touch::CommandedTouch touch = touch::TouchOfPlan(plan, *generator, number, 0);
      const uint64_t round = number * rig.rounds / generator->Count();
      if (!rig.speeds_mm_s.empty()) touch.speed_m_s = 1e-3 * rig.speeds_mm_s[round % rig.speeds_mm_s.size()];
      const auto fill = [&] {
        simulator.Prepare(1, &batch);
        batch.surface = surface;
        batch.seed = rig.seed;
        touch::SetTouch(touch, touch.speed_m_s, plan.touch_interval_s * set->touch.size(), set->touch.size(),
                        0, &batch);
        if (!set->touch.empty()) batch.pause_s[0] = plan.touch_interval_s;
      };
      fill();
      EXPECT_TRUE(simulator.RunToMotion(&batch, &workspace).ok());
      const std::vector<double> press_m = batch.press_m;
      fill();
      batch.previous_press_m = previous_press_m;
      EXPECT_TRUE(simulator.Run(&batch, &workspace).ok());
      previous_press_m = press_m;
      set->touch.push_back(set->touch.size());
      set->object.push_back(static_cast<int>(object));
      set->target_m.push_back(touch.target_m);
      set->approach.push_back(touch.approach);
      set->lateral.push_back(touch.lateral);
      set->standoff_m.push_back(touch.standoff_m);
      set->speed_m_s.push_back(touch.speed_m_s);
      set->session_time_s.push_back(batch.session_time_s[0]);
      set->line.push_back(static_cast<int>(set->touch.size()) + 1);
      for (int i = 0; i < 3; ++i) set->time_s.push_back(batch.reported_time_s[batch.At(i, 0)]);
    }
  }
  input.set = set;
  input.model = std::make_shared<const model::Model>(WithEffects(nominal, rig.known));
  return input;
}

}  // namespace touchstone::diagnosis::touches
