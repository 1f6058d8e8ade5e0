// The trial: sets of every arm, diagnosed and marked.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tests/hidden_effects/score/arms/arms.h"
#include "tests/hidden_effects/score/figures.h"
#include "tests/hidden_effects/score/judge.h"
#include "tests/hidden_effects/score/table.h"

namespace touchstone::hidden {

struct TrialOptions {
  Seeds seeds = Seeds::kTuning;
  double share = 1;               // of the sets of every arm, at least one each
  std::vector<std::string> arms;  // empty: all
  int threads = 2;
  bool baselines = true;
  double limit_s = 60;      // of CPU time for each diagnosis, which is then cancelled
  std::string dump_folder;  // sets that were judged wrong are written there; empty: nowhere
};

// One set, from drawing it to its marks.
struct Outcome {
  const Arm* arm = nullptr;
  uint64_t seed = 0;
  Set set;
  v1::Report report;
  Tried tried;  // what it claims, tried again
  std::vector<Mark> marks, figures, bic, rmse_drop, gp;
  double seconds = 0;      // of Diagnose, CPU time
  bool timed_out = false;  // there is no report, since it took too long
  std::string error;       // why there is no report; empty: there is one
};

Outcome RunOne(const Arm& arm, uint64_t seed, const TestObjects& objects, bool baselines,
               double limit_s = 600);

// Whether every answer about it was right.
bool AllRight(const Outcome& outcome);

struct TrialResult {
  Results results;
  int sets = 0, errors = 0;
  std::vector<double> seconds;           // of every Diagnose, sorted
  std::vector<double> full_set_seconds;  // of those with 960 touches
  int timed_out = 0;
};

// `each` is called after every set, from one thread at a time.
TrialResult RunTrial(const TrialOptions& options, const TestObjects& objects,
                     const std::function<void(const Outcome&, int done, int of)>& each);

}  // namespace touchstone::hidden
