#include "server/diagnosis/answers/session_rests.h"

#include <algorithm>
#include <string>
#include <utility>

#include "server/diagnosis/engine/ladder/ladder.h"

namespace touchstone::diagnosis {
namespace {

using engine::Verdict;

bool IsOfNoise(const model::Model& model, const std::string& effect) {
  return std::any_of(model.effects.begin(), model.effects.end(), [&](const model::EffectInstance& instance) {
    return instance.effect->random() && engine::NameOf(*instance.effect) == effect;
  });
}

}  // namespace

bool AsksForNoiseAlone(const report::Diagnosis& one) {
  if (!one.improved_model) return one.steps.empty() && one.refitted.empty();
  const auto noise = [&](const auto& named) { return IsOfNoise(*one.improved_model, named.effect); };
  return std::all_of(one.steps.begin(), one.steps.end(), noise) &&
         std::all_of(one.refitted.begin(), one.refitted.end(), noise);
}

Verdict SessionRests::Add(const report::Diagnosis& one, int session, model::Model* own) {
  const bool noise_alone = AsksForNoiseAlone(one);
  if (noise_alone)
    TakeNoise(one, own);
  else
    for (const report::Step& step : one.steps) asked_by_one_.push_back({session, step.effect});
  const bool asks = one.verdict == Verdict::kMissingEffects || one.verdict == Verdict::kWrongValues;
  const Verdict left = asks && !noise_alone ? Verdict::kUnexplained : one.verdict;
  if (left == Verdict::kUnexplained) unexplained_.push_back(session);
  return left;
}

void SessionRests::TakeNoise(const report::Diagnosis& one, model::Model* own) {
  if (!one.improved_model) return;
  std::string name = std::move(own->name);
  *own = *one.improved_model;
  own->name = std::move(name);
  changed_noise_ = true;
  for (const report::Step& step : one.steps) {
    const auto same = std::find_if(noise_steps_.begin(), noise_steps_.end(),
                                   [&](const report::Step& other) { return other.effect == step.effect; });
    if (same == noise_steps_.end())
      noise_steps_.push_back(step);
    else
      *same = step;
  }
}

}  // namespace touchstone::diagnosis
