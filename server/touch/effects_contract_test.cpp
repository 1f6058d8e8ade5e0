// The contract of every effect of the catalogue, through all four stages: at its neutral values nothing
// changes, at typical values something does, and the same seed gives the same result.
#include <gtest/gtest.h>

#include <cmath>

#include "server/effects/all_effects.h"
#include "server/geometry/shapes/supershape.h"
#include "server/touch/batch_row.h"
#include "server/touch/plan.h"
#include "server/touch/simulate.h"

namespace touchstone::touch {
namespace {

constexpr int kTouches = 60;

// Noise that some effects need to have something to act on.
model::Model WithNoise() {
  return *model::AddEffect(model::NominalModel(), "gaussian_noise", {"sigma_us=5000"}, effects::Catalogue());
}

std::vector<double> ReportedTimes(const model::Model& model) {
  static const auto surface = *geometry::Surface::Create(
      "lat10", *geometry::MakeSupershape(*geometry::NamedSupershape("lat10"), 5000));
  Plan plan;
  plan.kind = Plan::Kind::kFaces;
  plan.faces.samples_per_face = kTouches / 6;
  const auto generator = MakePoseGenerator(plan, surface->bounds(), 3);
  const TouchSimulator simulator(std::make_shared<const model::Model>(model));
  effects::TouchBatch batch;
  TouchWorkspace workspace;
  simulator.Prepare(kTouches, &batch);
  batch.surface = surface;
  batch.seed = 9;
  for (int k = 0; k < kTouches; ++k) {
    const CommandedTouch touch = TouchOfPlan(plan, *generator, k, 0);
    SetTouch(touch, touch.speed_m_s, 10.0 * k, k, k, &batch);
    for (int finger = 0; finger < batch.fingers(); ++finger)
      batch.previous_press_m[batch.At(finger, k)] = 0.001 * finger;
  }
  EXPECT_TRUE(simulator.Run(&batch, &workspace).ok());
  return batch.reported_time_s;
}

bool Same(const std::vector<double>& a, const std::vector<double>& b) {
  for (size_t k = 0; k < a.size(); ++k)
    if (a[k] != b[k] && !(std::isnan(a[k]) && std::isnan(b[k]))) return false;
  return true;
}

// `effect` on top of the noise, at its neutral values or at values of typical size.
model::Model With(const model::Effect& effect, bool typical) {
  model::Model model = effect.name == "gaussian_noise" ? model::NominalModel() : WithNoise();
  model::EffectInstance instance;
  instance.effect = effects::Catalogue().Find(effect.name);
  instance.per_object = effect.always_per_object;
  instance.values = effect.NeutralValues(model.fingers);
  size_t at = 0;
  for (const model::ParameterInfo& info : effect.parameters) {
    const int count = info.Count(model.fingers);
    for (int k = 0; typical && k < count; ++k)
      instance.values[at + k] = ToSi(info.unit, info.typical * (info.sum_zero ? k - 0.5 * (count - 1) : 1));
    at += count;
  }
  model.effects.push_back(instance);
  return model;
}

TEST(EveryEffect, ChangesNothingAtItsNeutralValues) {
  const std::vector<double> noisy = ReportedTimes(WithNoise()), ideal = ReportedTimes(model::NominalModel());
  for (const auto& effect : effects::TouchEffects())
    EXPECT_TRUE(Same(ReportedTimes(With(*effect, false)), effect->name == "gaussian_noise" ? ideal : noisy))
        << effect->name;
}

TEST(EveryEffect, ChangesReportedTimesAtTypicalValuesAndTheSameWayEveryTime) {
  const std::vector<double> noisy = ReportedTimes(WithNoise()), ideal = ReportedTimes(model::NominalModel());
  for (const auto& effect : effects::TouchEffects()) {
    if (effect->parameters.empty()) continue;  // the entry that describes formulas
    const std::vector<double> once = ReportedTimes(With(*effect, true));
    EXPECT_FALSE(Same(once, effect->name == "gaussian_noise" ? ideal : noisy)) << effect->name;
    EXPECT_TRUE(Same(once, ReportedTimes(With(*effect, true)))) << effect->name;
  }
}

// The order of noise effects in the file is not physics.
TEST(NoiseEffects, GiveTheSameTimesInWhateverOrderTheyStand) {
  const auto model = [](const std::vector<std::pair<const char*, const char*>>& effects) {
    model::Model model = model::NominalModel();
    for (const auto& [name, value] : effects)
      model = *model::AddEffect(model, name, {value}, effects::Catalogue());
    return model;
  };
  const auto a = model({{"gaussian_noise", "sigma_us=5000"},
                        {"incidence_noise", "slope=2"},
                        {"heavy_tail_noise", "degrees_of_freedom=4"}});
  const auto b = model({{"heavy_tail_noise", "degrees_of_freedom=4"},
                        {"incidence_noise", "slope=2"},
                        {"gaussian_noise", "sigma_us=5000"}});
  EXPECT_TRUE(Same(ReportedTimes(a), ReportedTimes(b)));
}

}  // namespace
}  // namespace touchstone::touch
