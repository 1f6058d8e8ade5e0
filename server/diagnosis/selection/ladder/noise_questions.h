// What is asked of the scatter of repeats and residuals once the effects are known, and the steps of noise that follow.
#pragma once

#include <optional>

#include "server/diagnosis/selection/ladder/hypotheses.h"
#include "server/diagnosis/selection/ladder/ladder.h"
#include "server/diagnosis/selection/scatter/pose_scatter.h"
#include "server/diagnosis/selection/scatter/random_delay.h"

namespace touchstone::diagnosis::selection {

class NoiseQuestions {
 public:
  // All must outlive it.
  NoiseQuestions(const touches::Observations& observations, const SelectionResult& selection,
                 engine::Hypotheses* found, Ladder* ladder);

  // By the hypotheses of their names.
  void AskPlay();
  void AskUnevenScatter();
  void AskRandomDelay();
  void AskLopsided();
  // Adds the steps of noise. `rounds_p`: of the agreement of repeats within rounds.
  void AddSteps(double rounds_p);

 private:
  bool ScatterHasAShape() const;
  touches::NoiseSample Sample() const;
  void DoubtSteps(size_t first, double rounds_p);

  const touches::Observations& observations_;
  const SelectionResult& selection_;
  engine::Hypotheses* found_;
  Ladder* ladder_;
  touches::NoiseFindings noise_;  // the selection's, without what other hypotheses explain
  std::optional<PoseScatter> pose_scatter_;
  std::optional<RandomDelay> delay_;
};

}  // namespace touchstone::diagnosis::selection
