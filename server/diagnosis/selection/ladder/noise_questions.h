// What is asked of the scatter of repeats and residuals once the effects are known, and the steps of noise that follow.
#pragma once

#include <optional>
#include <vector>

#include "server/diagnosis/selection/ladder/hypotheses.h"
#include "server/diagnosis/selection/ladder/ladder.h"
#include "server/diagnosis/selection/scatter/pose_scatter.h"
#include "server/diagnosis/selection/scatter/random_delay.h"

namespace touchstone::diagnosis::selection {

class NoiseQuestions {
 public:
  // `residuals_with_rest`: Climb's. All must outlive it.
  NoiseQuestions(const touches::Observations& observations, const SelectionResult& selection,
                 const std::vector<double>& residuals_with_rest, engine::Hypotheses* found, Ladder* ladder);

  // By the hypotheses of their names.
  void AskFingerTicks();
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
  const std::vector<double>& residuals_with_rest_;
  engine::Hypotheses* found_;
  Ladder* ladder_;
  touches::NoiseFindings noise_;  // the selection's, without what other hypotheses explain
  std::optional<PoseScatter> pose_scatter_;
  std::optional<RandomDelay> delay_;
};

}  // namespace touchstone::diagnosis::selection
