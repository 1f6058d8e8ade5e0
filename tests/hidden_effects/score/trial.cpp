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

namespace touchstone::hidden {
namespace {

// CPU time of this thread, so that other work on the machine does not count.
double ThreadSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// Measures that are wrong when they are true.
bool IsBad(const std::string& measure) {
  static const auto* bad =
      new std::set<std::string>{"false claim", "wrong name instead", "names a culprit", "false detection"};
  return bad->count(measure) > 0;
}

// What the suggested formula leaves of the mean square misfit, on fresh touches without noise, as a share.
double FormulaCutsTo(const Scenario& truth, uint64_t seed, const v1::Report& report,
                     const TestObjects& objects) {
  const std::string& formula = report.unexplained().formula_yaml();
  if (formula.empty()) return NAN;
  const Set fresh = Generate(truth, seed + 500'000);
  std::string yaml = fresh.model_yaml;
  // The suggestion is an item of the list of effects, with or without that list around it.
  const size_t list = formula.find("effects:");
  std::string item = list == std::string::npos ? formula : formula.substr(formula.find('\n', list) + 1);
  std::string indented;
  const std::string indent = item.compare(0, 2, "  ") == 0 ? "" : "  ";
  for (size_t begin = 0; begin < item.size();) {
    const size_t end = std::min(item.find('\n', begin), item.size());
    if (end > begin) indented += indent + item.substr(begin, end - begin) + "\n";
    begin = end + 1;
  }
  yaml += indented;
  const auto before = ExactRmseUs(fresh, fresh.model_yaml, objects),
             after = ExactRmseUs(fresh, yaml, objects);
  if (!before.ok() || !after.ok()) return std::numeric_limits<double>::infinity();
  return *after * *after / (*before * *before);
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

}  // namespace

Outcome RunOne(const Arm& arm, uint64_t seed, const TestObjects& objects, bool baselines) {
  Outcome out;
  out.arm = &arm;
  out.seed = seed;
  out.set = Generate(arm.draw(objects, seed), seed);
  const auto input = InputFor(out.set, objects);
  if (!input.ok()) return out.error = input.status().ToString(), out;
  const double start_s = ThreadSeconds();
  const auto diagnosis = diagnosis::Diagnose(*input, {});
  out.seconds = ThreadSeconds() - start_s;
  if (diagnosis.ok())
    out.report = diagnosis::report::ToReport(*diagnosis);
  else
    out.error = diagnosis.status().ToString();
  // Without a report every question is answered wrongly.
  double cuts_to = NAN;
  if (arm.kind == Kind::kUnlisted) cuts_to = FormulaCutsTo(out.set.truth, seed, out.report, objects);
  out.marks = Judge(arm, out.set.truth, out.report, cuts_to);
  if (!out.error.empty())
    for (Mark& mark : out.marks) mark.yes = IsBad(mark.measure);
  if (baselines) {
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
      const Outcome outcome = RunOne(arm, SeedOf(options.seeds, arm, tasks[t].k), objects, options.baselines);
      const std::lock_guard<std::mutex> lock(mutex);
      Count(arm, outcome.marks, &result.results.diagnosis);
      Count(arm, outcome.bic, &result.results.bic);
      Count(arm, outcome.rmse_drop, &result.results.rmse_drop);
      Count(arm, outcome.gp, &result.results.gp);
      ++result.sets;
      result.errors += !outcome.error.empty();
      result.seconds.push_back(outcome.seconds);
      if (!options.dump_folder.empty() && !AllRight(outcome)) WriteSet(options.dump_folder, outcome);
      each(outcome, result.sets, static_cast<int>(tasks.size()));
    }
  };
  std::vector<std::thread> threads;
  for (int k = 0; k < options.threads; ++k) threads.emplace_back(work);
  for (std::thread& thread : threads) thread.join();
  std::sort(result.seconds.begin(), result.seconds.end());
  return result;
}

}  // namespace touchstone::hidden
