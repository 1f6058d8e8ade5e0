// Which of the mistakes that were tried may be claimed.
#pragma once

#include <vector>

#include "server/base/threads/thread_pool.h"
#include "server/diagnosis/checks/trial.h"

namespace touchstone::diagnosis::checks {

// What a claim leaves of the error and of the data at most, and what the misfit is at least.
inline constexpr double kMaxRatio = 0.2;
inline constexpr double kMaxRelative = 0.25;
inline constexpr double kMaxBefore =
    2;  // what nonsense leaves, relative to the data: uncorrelated sqrt(2), reversed 2
inline constexpr double kMinMisfitM = 0.5e-3;
inline constexpr double kClear = 1.5;  // the next other kind is worse by this, unless kSure
inline constexpr double kSure = 0.05;  // ratio of errors

struct Tried {
  Mistake mistake;
  TrialResult after;
  double relative = 0;  // of the whole file
};

// Those that can be tried, in the order of likelihood.
std::vector<Tried> TryAll(const Trial& trial, const std::vector<Mistake>& mistakes, ThreadPool* pool);

// The best mistakes that may be claimed: all that fit alike. `tried` in the order of likelihood.
std::vector<Tried> Convincing(const std::vector<Tried>& tried, const TrialResult& before);

// Whether a factor of times or speeds is the discrete one: `scale` of what is left, with its error.
bool ScaleIsRight(const Mistake& mistake, double scale, double scale_error);

// A fix that changes the scale of times or speeds cannot be judged by lengths, which it changes too.
bool ChangesScale(const Mistake& mistake);

// Every mistake that is tried on a file as it stands, but heights to be fitted, the likelier ones first.
std::vector<Mistake> AllMistakes(const Trial& trial, const TrialResult& before);

}  // namespace touchstone::diagnosis::checks
