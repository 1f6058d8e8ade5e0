#include "server/diagnosis/images/photo_hypotheses.h"

namespace touchstone::diagnosis::images {

const std::vector<engine::HypothesisRule>& PhotoHypothesisRules() {
  using P = PhotoHypothesis;
  using L = engine::Leaves;
  static const auto& rules = *new std::vector<engine::HypothesisRule>{
      // A faint field takes what steps are judged by; steps that go leave more for a large one.
      {P::kFaintField, "faint image field", L::kNothing, {}},
      {P::kUnsteady, "unsteady step", L::kNothing, {}},
      // A smooth error of the albedo and of the picture take the place of such an effect, and of what lies beside it: they take
      // no part from then on.
      {P::kLargeStep, "large step", L::kNothing, {P::kAlbedo, P::kImageField}},
      // Of the steps that stay, with the values that they keep.
      {P::kChoice, "choice", L::kNothing, {}},
      {P::kWithoutGain, "step without gain", L::kNothing, {}},
      // What is left of the means, each by a test of its own.
      {P::kMisfit, "misfit", L::kMeans, {}},
      {P::kAlbedo, "albedo", L::kMeans, {}},
      {P::kDependence, "dependence", L::kMeans, {P::kUnknown}},
      {P::kImageField, "image field", L::kMeans, {}},
      // What says most of it: a kind of rest has words only where it takes more than a formula or a curve does.
      {P::kSuggestion, "formula or curve", L::kMeans, {P::kUnknown}},
      {P::kKindOfRest, "kind of rest", L::kMeans, {P::kUnknown}, 1, true},
      // Noise that differs from part to part is no misfit of the means, and has the first word only where there is none. It
      // may be all of a misfit; cut at black it looks like light of the ground, which speaks against steps.
      {P::kUnevenNoise, "uneven noise", L::kMeans, {P::kUnknown}, 2},
      {P::kUnknown, "unknown", L::kMeans, {}, 3},
  };
  return rules;
}

}  // namespace touchstone::diagnosis::images
