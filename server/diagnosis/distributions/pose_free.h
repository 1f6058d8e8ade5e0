// Sets without poses: only objects and times. Nothing can be compared touch by touch; what is compared are
// distributions, with those of sets that the model makes by the same plan. That is about two orders of
// magnitude weaker than a set with poses: the result says whether the model is compatible and with which
// effects it would be, and never names one culprit.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/distributions/compatible_effects.h"
#include "server/diagnosis/distributions/pose_free_description.h"
#include "server/diagnosis/distributions/round_findings.h"
#include "server/diagnosis/input.h"
#include "server/diagnosis/residuals/distribution/histogram_bins.h"

namespace touchstone::diagnosis::distributions {

// What the rounds of a set say about the model's noise.
enum class NoiseChange { kNone, kNewValue, kNewEffect };

struct PoseFreeComparison {
  PoseFreeRows rows;
  bool noise_is_known = false;      // from rounds that are enough to tell
  std::optional<RoundNoise> noise;  // set where it is known and not zero
  // The model that the set was compared with: the given one, with the noise of the rounds if that differs.
  std::shared_ptr<const model::Model> model;
  NoiseChange noise_change = NoiseChange::kNone;
  bool model_has_noise = false;  // EffectRole::kNoiseLevel
  double size_ratio = 1;         // of measured to simulated times where it is absurd (a wrong unit); else 1

  // The test. All p are probabilities of a set at least as far off if the model were right.
  double p_value = 1;            // all measures together
  bool compatible = true;        // p_value is not small
  double energy_distance_s = 0;  // between measured and simulated touches
  double energy_p_value = 1;
  std::vector<StatisticComparison> statistics;
  std::vector<residuals::ComparedHistogram> histograms;
  std::string plan;           // by which the simulated touches were made, in words
  int simulated_touches = 0;  // that the set is compared with

  // Set by a diagnosis only.
  bool diagnosed = false;
  std::vector<RoundFinding> findings;  // what repeats show among themselves
  std::vector<CompatibleEffect>
      compatible_effects;  // where the model is not compatible; most compatible first
};

// `diagnose`: also the effects of the catalogue with which the model would be compatible.
//
// The test: the model makes sets exactly like the measured one (objects, touches, rounds; other poses of the
// faces plan), and the measured set's distance to a large simulated reference takes its rank among theirs. If
// the model is right and the plan was that one, every rank is equally probable, whatever the touches of a set
// have in common; so p is exact. Noise is estimated anew first where the set goes in rounds.
//
// A pure function of `input`, whatever the number of threads. Errors: no complete touch, an object without a
// mesh, other numbers of fingers; CANCELLED if the progress callback says so.
absl::StatusOr<PoseFreeComparison> ComparePoseFree(const DiagnosisInput& input,
                                                   const DiagnosisContext& context, bool diagnose);

}  // namespace touchstone::diagnosis::distributions
