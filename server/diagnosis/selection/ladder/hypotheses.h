// What touches may show beside effects of the catalogue: what each such hypothesis excludes, whether it leaves a rest without a
// name, and which of several is said. How each is found stands in a file of its own.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "server/diagnosis/engine/competition/result.h"

namespace touchstone::diagnosis::selection {

// In the order in which they are said: the first of those that were found says what is left.
enum class Hypothesis {
  kGroup,            // one part of the session differs by one effect (group_difference.h)
  kPartialOffset,    // some touches, no part of the session, have an offset (partial_offset.h)
  kRandomWalk,       // a random walk of the fingers (noise_memory.h)
  kCorrelatedNoise,  // noise with a known memory (noise_memory.h)
  kCurve,            // a curve over one covariate (nameless_curve.h)
  kFormula,          // a term of the dictionary, or such a curve as a part of the model (formula_terms.h)
  kUnplaced,         // a misfit that repeats with the pose and not with the place (surface_support.h)
  kRemounted,        // the object lies elsewhere in every round (round_structure.h)
  kStrangeValues,    // values at their bounds, many of sizes that no rig shows (doubts.h)
  kUnevenScatter,    // the noise differs between parts of the set (uneven_scatter.h)
  kRandomDelay,      // some readings come late by a random amount (random_delay.h)
  kLopsided,         // the noise reaches farther to one side (lopsided_scatter.h)
  kSetAside,         // what the fit set aside is more than a few gross errors (touches_set_aside.h)
  kTicks,            // some of the times were read in ticks (touches/noise/ticks.h)
  kPlay,    // the object lies elsewhere, or the arm is faster or slower, at every touch (pose_scatter.h)
  kCourse,  // repeats share a course in time (time_structure.h)
  kMisfit,  // a lack of fit, of whatever kind (engine/findings.h)
};

// What is asked of the residuals once the effects are known.
enum class Question {
  kRounds,         // do repeats agree within rounds?
  kSurface,        // are there bumps?
  kPoseScatter,    // do repeats scatter as an object does that moves?
  kNoise,          // which noise of the fingers?
  kUnevenScatter,  // does it differ between parts of the set?
  kAbsentMemory,   // does the correlated noise that the model has show at all?
  kCourse,         // do repeats share a course in time?
  kMisfit,         // is there a lack of fit?
};

// What a hypothesis leaves without a name; all but the first make the verdict UNEXPLAINED.
enum class Leaves {
  kNothing,
  kScatter,  // of the noise alone: nothing is said against effects, which move means
  kMeans,
  kDoubts,  // of the means, and it speaks against the steps that were found
};

struct HypothesisRule {
  Hypothesis hypothesis;
  const char* name;
  Leaves leaves;
  std::vector<Question> excludes;  // which it would answer, whatever the answer is
};

// One a hypothesis, in the order of the enumeration.
const std::vector<HypothesisRule>& HypothesisRules();

// Those that were found in one set.
class Hypotheses {
 public:
  using NameFirst = std::function<void(engine::UnexplainedRest*)>;

  // `words`: sentences for people; may be empty. `name_first` puts the covariate that it is about among those of the rest;
  // what is added later stands in front.
  void Add(Hypothesis hypothesis, std::string words = "", NameFirst name_first = nullptr);
  bool Has(Hypothesis hypothesis) const;
  bool Allows(Question question) const;

  bool Leave(Leaves least) const;  // this or more
  // Of the first that has words; of a curve, followed by those of the next.
  std::string Words() const;
  void NameCovariates(engine::UnexplainedRest* rest) const;

 private:
  struct Found {
    const HypothesisRule* rule;
    std::string words;
    NameFirst name_first;
  };
  template <typename Predicate>
  bool Any(Predicate predicate) const;

  std::vector<Found> found_;  // in the order in which they were added
};

}  // namespace touchstone::diagnosis::selection
