#include "server/diagnosis/selection/ladder/noise_questions.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <string>
#include <utility>

#include "server/base/text/readable_time.h"
#include "server/diagnosis/selection/ladder/rules.h"
#include "server/diagnosis/selection/scatter/lopsided_scatter.h"
#include "server/diagnosis/selection/scatter/uneven_scatter.h"
#include "server/diagnosis/touches/noise/noise_sample.h"
#include "server/diagnosis/touches/noise/ticks.h"
#include "server/effects/all_effects.h"
#include "server/model/finger_name.h"

namespace touchstone::diagnosis::selection {
namespace {

void DoubtStep(const std::string& words, engine::LadderStep* step) {
  step->probability = std::min(step->probability, kLadderRules.max_beside_other.value());
  engine::AddWords(words, step);
}

}  // namespace

NoiseQuestions::NoiseQuestions(const touches::Observations& observations, const SelectionResult& selection,
                               const std::vector<double>& residuals_with_rest, engine::Hypotheses* found,
                               Ladder* ladder)
    : observations_(observations),
      selection_(selection),
      residuals_with_rest_(residuals_with_rest),
      found_(found),
      ladder_(ladder),
      noise_(selection.noise) {}

// A finger whose column was rounded, or whose contact is polled, scatters more than the others for that reason.
void NoiseQuestions::AskFingerTicks() {
  if (selection_.noise.poll_interval_s.gain_nats > 0) return;
  const touches::FingerTicks ticks = touches::FindFingerTicks(observations_);
  if (ticks.interval_s == 0) return;
  found_->Add(
      Hypothesis::kFingerTicks,
      absl::StrFormat("Every time of finger %s is a multiple of %s, the others' times are not: its contact "
                      "is polled, or its column was rounded. Read it as the others are read.",
                      model::FingerName(ticks.finger, observations_.fingers), TimeInWords(ticks.interval_s)));
}

// Repeats differ by what depends on time or on the touch before, which is neither play nor scatter.
void NoiseQuestions::AskPlay() {
  pose_scatter_ = FindPoseScatter(observations_, ladder_->prediction, residuals_with_rest_, selection_.noise);
  if (pose_scatter_ && pose_scatter_->ahead) found_->Add(Hypothesis::kPlay, pose_scatter_->words);
}

// Not of what a misfit makes, and not of ticks.
bool NoiseQuestions::ScatterHasAShape() const {
  return !ladder_->noise_floor.is_rounding && !(selection_.noise.poll_interval_s.gain_nats > 0) &&
         !found_->Leave(engine::Leaves::kMeans) && selection_.fit.hypothesis == 0;
}

touches::NoiseSample NoiseQuestions::Sample() const {
  return touches::MakeNoiseSample(observations_, residuals_with_rest_, ladder_->prediction);
}

// Where something else makes touches scatter, parts of the set scatter differently for that reason; repeats know nothing
// of a misfit.
void NoiseQuestions::AskUnevenScatter() {
  const bool misfit = found_->Has(Hypothesis::kFormula) || found_->Has(Hypothesis::kMisfit) ||
                      found_->Has(Hypothesis::kUnplaced) || found_->Leave(engine::Leaves::kDoubts) ||
                      selection_.fit.hypothesis != 0;
  if (ladder_->noise_floor.is_rounding || (!ladder_->noise_floor.from_repeats && misfit)) return;
  std::optional<UnevenScatter> uneven =
      FindUnevenScatter(observations_, ladder_->prediction, Sample(), selection_.noise);
  if (!uneven) return;
  if (!uneven->tails_remain) noise_.degrees_of_freedom = {};
  if (uneven->finger >= 0) noise_.channel_sigma_s.clear();
  found_->Add(Hypothesis::kUnevenScatter, uneven->words,
              [scatter = *uneven, found = found_](engine::UnexplainedRest* rest) {
                NameUnevenScatter(scatter, found->Leave(engine::Leaves::kMeans), rest);
              });
}

// What comes late now and then looks like more noise, or heavy-tailed.
void NoiseQuestions::AskRandomDelay() {
  if (!ScatterHasAShape()) return;
  delay_ = FindRandomDelay(Sample(), selection_.noise, observations_.fingers);
  if (!delay_ || !delay_->ahead) return;
  found_->Add(Hypothesis::kRandomDelay, delay_->words);
  noise_ = WithoutDelays(*delay_, std::move(noise_));
}

void NoiseQuestions::AskLopsided() {
  if (!ScatterHasAShape()) return;
  const auto lopsided = FindLopsidedScatter(Sample().groups, observations_.fingers);
  if (!lopsided) return;
  found_->Add(Hypothesis::kLopsided, lopsided->words);
  noise_.degrees_of_freedom = {};
}

void NoiseQuestions::AddSteps(double rounds_p) {
  const size_t first = ladder_->steps.size();
  if (ladder_->noise_floor.is_rounding) return;
  AddNoiseSteps(noise_, selection_.memory.has_value(), ladder_);
  DoubtSteps(first, rounds_p);
}

// Of the steps of noise, what an object that moves, or a random delay, would look like.
void NoiseQuestions::DoubtSteps(size_t first, double rounds_p) {
  const std::string level = effects::FindByRole(model::EffectRole::kNoiseLevel)->name;
  const std::string tails = effects::FindByRole(model::EffectRole::kNoiseTails)->name;
  for (size_t j = first; j < ladder_->steps.size(); ++j) {
    engine::LadderStep* step = &ladder_->steps[j];
    if (rounds_p < kLadderRules.rounds_possible_p)
      DoubtStep("Repeats agree within rounds: an object put down anew each round would look alike.", step);
    if (pose_scatter_ && step->effect != level) DoubtStep(pose_scatter_->words, step);
    if (delay_ && step->effect == tails) DoubtStep(delay_->words, step);
  }
}

}  // namespace touchstone::diagnosis::selection
