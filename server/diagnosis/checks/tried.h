// Which of the mistakes that were tried may be claimed.
#pragma once

#include <vector>

#include "server/base/threads/thread_pool.h"
#include "server/diagnosis/checks/trial.h"

namespace touchstone::diagnosis::checks {

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
