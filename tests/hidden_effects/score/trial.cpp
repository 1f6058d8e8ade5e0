#include "tests/hidden_effects/score/trial.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <ctime>
#include <fstream>
#include <limits>
#include <mutex>
#include <set>
#include <thread>

#include "tests/hidden_effects/score/baselines.h"
#include "tests/hidden_effects/score/verify.h"

namespace touchstone::hidden {
namespace {

constexpr int kFullSet = 960;

// CPU time of this thread, so that other work on the machine does not count.
double ThreadSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// Measures that are wrong when they are true.
bool IsBad(const std::string& measure) {
  static const auto* bad = new std::set<std::string>{
      "false claim",       "wrong name instead", "names a culprit",     "false detection",
      "confidently wrong", "probability of 1",   "fall not found again"};
  return bad->count(measure) > 0;
}

void WriteSet(const std::string& folder, const Outcome& outcome) {
  std::string name = outcome.arm->name + " " + std::to_string(outcome.seed);
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '-';
  std::ofstream(folder + "/" + name + ".csv") << outcome.set.csv;
  std::ofstream(folder + "/" + name + ".yaml") << outcome.set.model_yaml;
  std::ofstream(folder + "/" + name + ".txt") << TruthInWords(outcome.set.truth) << '\n'
                                              << ReportInWords(outcome.report) << '\n'
                                              << outcome.error << '\n';
}

void Count(const Arm& arm, const std::vector<Mark>& marks, Rates* rates) {
  for (const Mark& mark : marks) {
    Rate& rate = (*rates)[{arm.name, mark.measure}];
    ++rate.of;
    rate.yes += mark.yes;
  }
}

void JudgeOutcome(const TestObjects& objects, Outcome* out) {
  const Arm& arm = *out->arm;
  const Scenario& truth = out->set.truth;
  const v1::Unexplained& unexplained = TouchEntry(out->report).unexplained();
  Tried& tried = out->tried;
  if (arm.kind == Kind::kUnlisted)
    tried.formula_cuts_to = CutsTo(truth, out->seed, unexplained.formula_yaml(), objects);
  if (IsACurve(arm, truth))
    tried.lookup_cuts_to = CutsTo(truth, out->seed, unexplained.lookup_yaml(), objects);
  if (ClaimsAFall(out->report)) {
    constexpr double kNone = std::numeric_limits<double>::infinity();
    tried.final_found_us = FinalRmseFoundAgainUs(out->set, out->report, objects).value_or(kNone);
    tried.fresh_us = FreshRmseUs(truth, out->seed, out->report, objects).value_or(kNone);
  }
  out->marks = Judge(arm, truth, out->report, tried.formula_cuts_to);
  if (out->error.empty()) {
    out->figures = JudgeFigures(arm, truth, out->report, out->marks, tried);
    return;
  }
  // Without a report every question is answered wrongly, but nothing was claimed.
  for (Mark& mark : out->marks) mark.yes = IsBad(mark.measure);
  // A file that is refused, with the reason, misleads nobody.
  const bool refused = arm.kind == Kind::kDataError && !out->timed_out;
  out->figures = {{"right", false}, {"honest", refused}, {"confidently wrong", false}};
  if (arm.depends_on_time) out->figures.push_back({"unexplained by time", false});
  if (IsACurve(arm, truth)) out->figures.push_back({"lookup halves the misfit", false});
}

}  // namespace

Outcome RunOne(const Arm& arm, uint64_t seed, const TestObjects& objects, bool baselines, double limit_s) {
  Outcome out;
  out.arm = &arm;
  out.seed = seed;
  out.set = Generate(arm.draw(objects, seed), seed);
  const auto input = InputFor(out.set, objects);
  if (!input.ok()) return out.error = input.status().ToString(), out;
  const double start_s = ThreadSeconds();
  diagnosis::DiagnosisContext context;
  context.progress = [&](const std::string&, double) { return ThreadSeconds() - start_s < limit_s; };
  const auto diagnosis = diagnosis::Diagnose(*input, context);
  out.seconds = ThreadSeconds() - start_s;
  if (diagnosis.ok()) {
    out.report = diagnosis::report::ToReport(*diagnosis);
  } else {
    out.error = diagnosis.status().ToString();
    out.timed_out = absl::IsCancelled(diagnosis.status());
  }
  JudgeOutcome(objects, &out);
  if (diagnosis.ok() && arm.copies > 0) {
    const std::vector<Mark> covered =
        CoverageOfCopies(arm, out.set.truth, out.report, seed, arm.copies, objects);
    out.marks.insert(out.marks.end(), covered.begin(), covered.end());
  }
  if (baselines && arm.strength == Strength::kNone) {
    const auto others = RunBaselines(*input);
    if (others.ok() && arm.kind != Kind::kNoPoses) {
      out.bic = JudgeNames(arm, out.set.truth, others->bic);
      out.rmse_drop = JudgeNames(arm, out.set.truth, others->rmse_drop);
      for (const Mark& mark : out.bic) out.gp.push_back({mark.measure, others->gp_detects});
    }
  }
  return out;
}

bool AllRight(const Outcome& outcome) {
  if (!outcome.error.empty()) return false;
  for (const Mark& mark : outcome.marks)
    if (mark.yes == IsBad(mark.measure)) return false;
  for (const Mark& mark : outcome.figures)
    if ((mark.measure == "confidently wrong" && mark.yes) || (mark.measure == "right" && !mark.yes))
      return false;
  return true;
}

TrialResult RunTrial(const TrialOptions& options, const TestObjects& objects,
                     const std::function<void(const Outcome&, int, int)>& each) {
  struct Task {
    const Arm* arm;
    int k;
  };
  std::vector<Task> tasks;
  for (const Arm& arm : Arms()) {
    if (!options.arms.empty() && std::count(options.arms.begin(), options.arms.end(), arm.name) == 0)
      continue;
    const int sets = std::max(1, static_cast<int>(std::lround(options.share * arm.sets)));
    for (int k = 0; k < sets; ++k) tasks.push_back({&arm, k});
  }

  TrialResult result;
  std::mutex mutex;
  std::atomic<size_t> next{0};
  const auto work = [&] {
    for (size_t t = next++; t < tasks.size(); t = next++) {
      const Arm& arm = *tasks[t].arm;
      const Outcome outcome =
          RunOne(arm, SeedOf(options.seeds, arm, tasks[t].k), objects, options.baselines, options.limit_s);
      const std::lock_guard<std::mutex> lock(mutex);
      Count(arm, outcome.marks, &result.results.diagnosis);
      Count(arm, outcome.figures, &result.results.diagnosis);
      Count(arm, outcome.bic, &result.results.bic);
      Count(arm, outcome.rmse_drop, &result.results.rmse_drop);
      Count(arm, outcome.gp, &result.results.gp);
      ++result.sets;
      result.errors += !outcome.error.empty();
      result.timed_out += outcome.timed_out;
      result.seconds.push_back(outcome.seconds);
      if (outcome.set.touches == kFullSet) result.full_set_seconds.push_back(outcome.seconds);
      if (!options.dump_folder.empty() && !AllRight(outcome)) WriteSet(options.dump_folder, outcome);
      each(outcome, result.sets, static_cast<int>(tasks.size()));
    }
  };
  std::vector<std::thread> threads;
  for (int k = 0; k < options.threads; ++k) threads.emplace_back(work);
  for (std::thread& thread : threads) thread.join();
  std::sort(result.seconds.begin(), result.seconds.end());
  std::sort(result.full_set_seconds.begin(), result.full_set_seconds.end());
  return result;
}

}  // namespace touchstone::hidden
