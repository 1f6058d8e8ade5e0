#include "server/diagnosis/selection/ladder/hypotheses.h"

namespace touchstone::diagnosis::selection {

const std::vector<engine::HypothesisRule>& HypothesisRules() {
  using H = Hypothesis;
  using L = engine::Leaves;
  // Under correlated noise repeats are alike by chance: tests of their scatter do not hold.
  const std::vector<int> of_scatter = {
      H::kCourse,       H::kRemounted,       H::kUnplaced,    H::kPlay,
      H::kMisfit,       H::kUnevenScatter,   H::kRandomDelay, H::kLopsided,
      H::kAbsentMemory, H::kCorrelatedNoise, H::kTurns,       H::kMovingObject};
  // What makes the means of touches differ makes them scatter.
  const std::vector<int> shapes_of_noise = {H::kPlay, H::kNoise, H::kUnevenScatter, H::kRandomDelay,
                                            H::kLopsided};
  static const auto& rules = *new std::vector<engine::HypothesisRule>{
      // First what the search has found in the place of effects: it explains what tests of the scatter would find.
      {H::kRandomWalk, "random walk", L::kMeans, of_scatter, 3},
      {H::kCorrelatedNoise, "correlated noise", L::kNothing, of_scatter},
      // Parts of a session that share a course scatter differently for that reason.
      {H::kCourse, "course", L::kMeans, {H::kUnevenScatter}},
      {H::kGroup, "group", L::kMeans, {}, 1},
      // Touches with and without the offset make bumps, rounds and tails of every kind.
      {H::kPartialOffset,
       "partial offset",
       L::kMeans,
       {H::kRemounted, H::kUnplaced, H::kPlay, H::kNoise, H::kUnevenScatter},
       2},
      {H::kFormula, "formula", L::kMeans, {H::kMisfit}},
      // A curve of time looks like rounds, and any curve like bumps. What else is left may lie beside it.
      {H::kCurve, "curve", L::kMeans, {H::kRemounted, H::kUnplaced}, 4, true},
      // Steps that are doubted leave bumps that are none.
      {H::kStrangeValues, "strange values", L::kDoubts, {H::kUnplaced}, 7},
      {H::kTurns, "turns", L::kMeans, shapes_of_noise, 14},
      // Rounds of an object that moves differ, and its bumps and slopes do.
      {H::kMovingObject,
       "moving object",
       L::kMeans,
       {H::kRemounted, H::kUnplaced, H::kMisfit, H::kPlay, H::kNoise, H::kUnevenScatter, H::kRandomDelay,
        H::kLopsided},
       15},
      // What scatters where the object lay elsewhere in every round is no property of the sensor.
      {H::kRemounted,
       "remounted",
       L::kDoubts,
       {H::kUnplaced, H::kPlay, H::kNoise, H::kUnevenScatter, H::kAbsentMemory},
       6},
      {H::kTicks, "ticks", L::kMeans, {}, 12},
      {H::kFingerTicks, "ticks of a finger", L::kBeside, shapes_of_noise, 16},
      {H::kSetAside, "set aside", L::kMeans, {}, 11},
      // Bumps of the surface take what a lack of fit would be judged by.
      {H::kUnplaced, "unplaced misfit", L::kMeans, {}, 5},
      // Noise comes last: whatever moves an object looks like noise of the fingers.
      {H::kPlay, "play", L::kMeans, {H::kNoise, H::kUnevenScatter}, 13},
      {H::kMisfit, "misfit", L::kMeans, {}},
      // Parts with more noise make tails, and so do delays; of one shape for all the other is none.
      {H::kUnevenScatter, "uneven scatter", L::kBeside, {H::kRandomDelay, H::kLopsided}, 8},
      {H::kRandomDelay, "random delay", L::kBeside, {H::kLopsided}, 9},
      {H::kLopsided, "lopsided scatter", L::kBeside, {}, 10},
      {H::kNoise, "noise", L::kNothing, {}},
      {H::kAbsentMemory, "absent memory", L::kNothing, {}},
  };
  return rules;
}

}  // namespace touchstone::diagnosis::selection
