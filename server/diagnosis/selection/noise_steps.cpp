// The kind of noise, as steps where the model has none of it, as refits where its values are others.
#include <algorithm>
#include <cmath>

#include "server/diagnosis/selection/ladder.h"
#include "server/effects/all_effects.h"

namespace touchstone {
namespace {

constexpr double kSignificant = 3.3;   // standard errors, for a refit
constexpr double kRelevant = 0.02;     // relative change, for a refit
constexpr double kMinSigmaS = 1.5e-6;  // less is the rounding of the file

class NoiseWriter {
 public:
  NoiseWriter(Ladder* ladder, v1::Report* report) : ladder_(ladder), report_(report) {}

  // One effect with one parameter; nothing is written unless it is claimed.
  void Write(const char* name, const NoiseEstimate& found, bool claimed) {
    if (!claimed) return;
    EffectInstance* present = nullptr;
    for (EffectInstance& instance : ladder_->improved.effects)
      if (instance.effect->name == name) present = &instance;
    const auto effect = Catalogue().Find(name);
    const ParameterInfo& parameter = effect->parameters[0];
    const double value = FromSi(parameter.unit, std::clamp(found.value, ToSi(parameter.unit, parameter.lower),
                                                           ToSi(parameter.unit, parameter.upper)));
    const double error = FromSi(parameter.unit, found.std_error);
    v1::ParameterValue described;
    described.set_name(parameter.name);
    described.set_unit(std::string(UnitSymbol(parameter.unit)));
    described.set_value(value);
    described.set_std_error(error);
    described.set_lower(std::max(parameter.lower, value - 1.96 * error));
    described.set_upper(std::min(parameter.upper, value + 1.96 * error));
    const double rounded = RoundedTo(value, error);
    if (present != nullptr) {
      const double before = FromSi(parameter.unit, present->values[0]);
      if (std::abs(value - before) < kSignificant * error || std::abs(value - before) < kRelevant * value)
        return;
      described.set_before(before);
      v1::Refit* refit = report_->add_refitted();
      refit->set_effect(name);
      *refit->add_parameters() = std::move(described);
      present->values[0] = ToSi(parameter.unit, rounded);
      present->object_values.clear();
      ladder_->changed = true;
      return;
    }
    v1::Step* step = report_->add_steps();
    step->set_effect(name);
    step->set_scope("rig");
    step->set_meaning(effect->meaning);
    step->set_check_on_rig(effect->check_on_rig);
    step->set_remedy(effect->remedy);
    step->set_gain_nats(found.gain_nats);
    step->set_probability(1 / (1 + std::exp(-std::min(found.gain_nats, 700.0))));
    *step->add_parameters() = std::move(described);
    // Noise changes no expectation: the errors stay.
    step->set_rmse_us(report_->final().rmse_us());
    step->set_heldout_rmse_us(report_->final().heldout_rmse_us());
    step->set_lack_of_fit_p(report_->final().lack_of_fit_p());
    EffectInstance instance;
    instance.effect = effect;
    instance.values = effect->NeutralValues(ladder_->improved.fingers);
    instance.values[0] = ToSi(parameter.unit, rounded);
    ladder_->improved.effects.push_back(std::move(instance));
    ladder_->changed = true;
  }

 private:
  Ladder* ladder_;
  v1::Report* report_;
};

}  // namespace

void AddNoise(const NoiseFindings& noise, Ladder* ladder, v1::Report* report) {
  NoiseWriter writer(ladder, report);
  const bool has_sigma =
      std::any_of(ladder->improved.effects.begin(), ladder->improved.effects.end(),
                  [](const EffectInstance& e) { return e.effect->name == "gaussian_noise"; });
  NoiseEstimate sigma = noise.sigma_s;
  sigma.gain_nats = 1e3;  // noise is there or not: any scatter beyond rounding proves it
  // Where ticks explain the scatter there is no further noise to be seen.
  const bool scatter = sigma.value > kMinSigmaS;
  writer.Write("gaussian_noise", sigma, has_sigma ? scatter : scatter && report->noise_floor_us() > 2);
  writer.Write("incidence_noise", noise.slope, noise.slope.gain_nats > 0);
  writer.Write("heavy_tail_noise", noise.degrees_of_freedom, noise.degrees_of_freedom.gain_nats > 0);
  writer.Write("poll_interval", noise.poll_interval_s, noise.poll_interval_s.gain_nats > 0);
  writer.Write("missed_contact", noise.missed_probability, noise.missed_probability.gain_nats > 0);
}

}  // namespace touchstone
