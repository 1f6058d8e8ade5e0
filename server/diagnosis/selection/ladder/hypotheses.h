// What touches may show beside effects of the catalogue. How each is found stands in a file of its own.
#pragma once

#include <vector>

#include "server/diagnosis/engine/ladder/hypotheses.h"

namespace touchstone::diagnosis::selection {

// In the order in which they are asked.
struct Hypothesis {
  enum {
    kRandomWalk,       // a random walk of the fingers (noise_memory.h)
    kCorrelatedNoise,  // noise with a known memory (noise_memory.h)
    kCourse,           // repeats share a course in time (time_structure.h)
    kGroup,            // one part of the session differs by one effect (group_difference.h)
    kPartialOffset,    // some touches, no part of the session, have an offset (partial_offset.h)
    kFormula,          // a term of the dictionary, or such a curve as a part of the model (formula_terms.h)
    kCurve,            // a curve over one covariate (nameless_curve.h)
    kStrangeValues,    // values at their bounds, many of sizes that no rig shows (doubts.h)
    kTurns,            // touches take turns (turns.h)
    kMovingObject,     // the object moves steadily while it is touched (moving_object.h)
    kRemounted,        // the object lies elsewhere in every round (round_structure.h)
    kTicks,            // some of the times were read in ticks (touches/noise/ticks.h)
    kFingerTicks,      // one finger's times were read in ticks (touches/noise/ticks.h)
    kSetAside,         // what the fit set aside is more than a few gross errors (touches_set_aside.h)
    kUnplaced,  // bumps of the surface, or a misfit that repeats with the pose and not with the place (surface_support.h)
    kPlay,    // the object lies elsewhere, or the arm is faster or slower, at every touch (pose_scatter.h)
    kMisfit,  // a lack of fit, of whatever kind (engine/findings.h)
    kUnevenScatter,  // the noise differs between parts of the set (uneven_scatter.h)
    kRandomDelay,    // some readings come late by a random amount (random_delay.h)
    kLopsided,       // the noise reaches farther to one side (lopsided_scatter.h)
    kNoise,          // which noise of the fingers: steps, nothing without a name (noise_steps.cpp)
    kAbsentMemory,   // the correlated noise that the model has does not show (noise_memory.h)
  };
};

const std::vector<engine::HypothesisRule>& HypothesisRules();

}  // namespace touchstone::diagnosis::selection
