// What a search of photographs tries.
#include <algorithm>
#include <iterator>

#include "server/diagnosis/engine/effect_columns.h"
#include "server/diagnosis/images/pixels/image_field.h"
#include "server/diagnosis/images/search/photo_search.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr double kWidthStarts[] = {0.5, 1.0};  // over the typical size

// Where the last of several parameters changes nothing until the first does, further places to start from; and for
// widths, which blur so little near zero that no slope leads away from there.
void AddStarts(const engine::Candidate& candidate, int fingers, std::vector<engine::Candidate>* all) {
  const model::Effect& effect = *candidate.effect;
  if (MovesRays(effect) || effect.parameters.empty() || effect.formula != nullptr) return;
  const model::ParameterInfo& last = effect.parameters.back();
  const bool width = effect.parameters.size() == 1 && last.unit == Unit::kPixel && last.lower == last.neutral;
  if (effect.parameters.size() < 2 && !width) return;
  std::vector<double> tried = {last.neutral};
  const std::vector<double> starts =
      width ? std::vector<double>(std::begin(kWidthStarts), std::end(kWidthStarts))
            : std::vector<double>{-1.0, 1.0, 2.0};
  for (const double times : starts) {
    const double value = std::clamp(last.neutral + times * last.typical, last.lower, last.upper);
    if (std::find(tried.begin(), tried.end(), value) != tried.end()) continue;
    tried.push_back(value);
    engine::Candidate further = candidate;
    further.starts_at = effect.NeutralValues(fingers);
    further.starts_at.back() = value * SiFactor(last.unit);
    all->push_back(std::move(further));
  }
}

// A choice is the camera's, whatever it looks at.
bool HasChoices(const model::Effect& effect) {
  return std::any_of(effect.parameters.begin(), effect.parameters.end(),
                     [](const model::ParameterInfo& parameter) { return !parameter.choices.empty(); });
}

}  // namespace

std::vector<engine::Candidate> NamedOfRig(const std::vector<engine::Candidate>& candidates) {
  std::vector<engine::Candidate> named;
  for (const engine::Candidate& candidate : candidates)
    if (!candidate.nameless && !candidate.per_object && candidate.object.empty()) named.push_back(candidate);
  return named;
}

std::vector<engine::Candidate> PhotoCandidates(const DiagnosisInput& input, const Photographs& photographs) {
  std::vector<engine::Candidate> candidates;
  std::vector<std::shared_ptr<const model::Effect>> effects;
  for (const auto& effect : effects::TouchEffects())
    if (effect->moves_surface && !input.IsSettled(effect->name)) effects.push_back(effect);
  for (const auto& effect : effects::PhotoEffects()) effects.push_back(effect);
  effects.push_back(ImageFieldEffect());
  for (const auto& effect : effects) {
    if (effect->parameters.empty() || !ShowsInPhotographs(*effect) ||
        engine::HasEffect(*input.model, engine::NameOf(*effect)))
      continue;
    engine::Candidate candidate;
    candidate.effect = effect;
    candidate.nameless = effect->name == kImageFieldName;
    candidates.push_back(candidate);
    if (candidate.nameless) continue;
    AddStarts(candidate, input.model->fingers, &candidates);
    if (photographs.objects.size() < 2 || HasChoices(*effect)) continue;
    candidate.per_object = true;
    if (effect->often_per_object) candidates.push_back(candidate);
    // What is the camera's may have changed while one object was photographed.
    for (const std::string& object : photographs.objects) {
      candidate.object = object;
      candidate.rare = true;
      candidates.push_back(candidate);
    }
  }
  for (const auto& effect : input.also)
    if (ShowsInPhotographs(*effect) && effect->of_photos() &&
        !engine::HasEffect(*input.model, engine::NameOf(*effect))) {
      engine::Candidate candidate;
      candidate.effect = effect;
      candidate.of_user = true;
      candidates.push_back(candidate);
    }
  return candidates;
}

}  // namespace touchstone::diagnosis::images
