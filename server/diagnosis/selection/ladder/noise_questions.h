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
                 Hypotheses* found, Ladder* ladder);

  // Adds the step of correlated noise, and asks whether repeats scatter as if something moved.
  void AskPoseScatter();
  // Asks the other questions and adds the steps of noise. `rounds_p`: of the agreement of repeats within rounds.
  void AddSteps(double rounds_p);

 private:
  void AskUnevenScatter(touches::NoiseFindings* noise);
  void AskShapeOfScatter(const touches::NoiseSample& sample, touches::NoiseFindings* noise);
  void DoubtSteps(double rounds_p);

  const touches::Observations& observations_;
  const SelectionResult& selection_;
  Hypotheses* found_;
  Ladder* ladder_;
  size_t first_of_noise_ = 0;  // step
  std::optional<PoseScatter> pose_scatter_;
  std::optional<RandomDelay> delay_;
};

}  // namespace touchstone::diagnosis::selection
