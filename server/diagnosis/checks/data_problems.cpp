#include "server/diagnosis/checks/data_problems.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/base/readable_time.h"
#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/checks/duplicates.h"
#include "server/diagnosis/checks/object_mistakes.h"
#include "server/diagnosis/checks/sampled_set.h"
#include "server/diagnosis/checks/sorted_column.h"
#include "server/diagnosis/checks/trial.h"
#include "server/diagnosis/selection/workspace.h"
#include "server/model/finger_name.h"

namespace touchstone::diagnosis::checks {
namespace {

constexpr int kMinTouches = 12;
constexpr double kMinMisfitM = 0.5e-3;
constexpr double kScaleTolerance = 0.02;    // physics that is missing biases the factor by about a hundredth
constexpr double kFarScaleTolerance = 0.2;  // of factors of ten on, which no physics comes near
constexpr double kTie = 1.1;                // errors within this factor are the same
constexpr double kClear = 1.5;              // the next other kind is worse by this, unless kSure
constexpr double kSure = 0.05;              // ratio of errors
constexpr double kSortedMisfit = 0.3;       // relative, from which a sorted column is one
constexpr size_t kMaxNamed = 3;

struct Tried {
  Mistake mistake;
  TrialResult after;
  double relative = 0;  // of the whole file
};

bool ScaleIsRight(const Mistake& mistake, const TrialResult& after) {
  const double factor = mistake.fix.scale_times * mistake.fix.scale_speed;
  if (factor == 1) return true;
  const bool far = factor > 9 || factor < 1 / 9.0;
  return std::abs(after.scale - 1) <= (far ? kFarScaleTolerance : kScaleTolerance) + 3 * after.scale_error;
}

// A fix that changes the scale of times or speeds cannot be judged by lengths, which it changes too.
bool ChangesScale(const Mistake& mistake) {
  return mistake.fix.scale_times != 1 || mistake.fix.scale_speed != 1;
}

double RatioOf(const Tried& tried, const TrialResult& before) {
  const std::vector<std::string>& names = tried.mistake.objects;
  const double was = std::min(before.Relative(names), kMaxBefore);
  return was > 0 ? tried.after.Relative(names) / was : 1;
}

bool Claimable(const Tried& tried, const TrialResult& before) {
  const std::vector<std::string>& names = tried.mistake.objects;
  if (!(RatioOf(tried, before) <= kMaxRatio) || !(tried.after.Relative(names) <= kMaxRelative)) return false;
  if (!ScaleIsRight(tried.mistake, tried.after)) return false;
  return ChangesScale(tried.mistake) || before.ErrorM(names) >= kMinMisfitM;
}

// The best mistakes that may be claimed: all that fit alike. `tried` in the order of likelihood.
std::vector<Tried> Convincing(std::vector<Tried> tried, const TrialResult& before) {
  const auto least = std::min_element(tried.begin(), tried.end(),
                                      [](const Tried& a, const Tried& b) { return a.relative < b.relative; });
  if (least == tried.end() || !Claimable(*least, before)) return {};
  std::vector<Tried> best;
  double next = INFINITY;
  const auto same_kind = [&](const Tried& one) {
    return std::any_of(best.begin(), best.end(),
                       [&](const Tried& other) { return other.mistake.kind == one.mistake.kind; });
  };
  for (const Tried& one : tried)
    if (one.relative <= kTie * least->relative && Claimable(one, before)) best.push_back(one);
  for (const Tried& one : tried)
    if (one.relative > kTie * least->relative && !same_kind(one)) next = std::min(next, one.relative);
  if (RatioOf(*least, before) > kSure && next < kClear * least->relative) return {};
  // Of one kind one is enough, the simplest; and a tie with a fitted size is no tie.
  std::vector<Tried> named;
  for (const Tried& one : best) {
    const bool again = std::any_of(named.begin(), named.end(), [&](const Tried& other) {
      return other.mistake.kind == one.mistake.kind;
    });
    if (!again && named.size() < kMaxNamed && !(one.mistake.free_size && !named.empty()))
      named.push_back(one);
  }
  return named;
}

std::vector<Tried> TryAll(const Trial& trial, const std::vector<Mistake>& mistakes, ThreadPool* pool) {
  std::vector<std::optional<Tried>> results(mistakes.size());
  ParallelFor(pool, static_cast<int>(mistakes.size()), 4, [&](int begin, int end) {
    for (int m = begin; m < end; ++m) {
      absl::StatusOr<TrialResult> after = trial.Run(mistakes[m].fix);
      if (!after.ok()) continue;
      const double relative = after->Relative({});
      results[m] = Tried{mistakes[m], *std::move(after), relative};
    }
  });
  std::vector<Tried> tried;
  for (std::optional<Tried>& result : results)
    if (result && !result->after.objects.empty()) tried.push_back(*std::move(result));
  return tried;
}

// What `compare` finds for this input; where it refuses, the error over all touches that can be compared.
double RmseOf(const DiagnosisInput& input, ThreadPool* pool) {
  DiagnosisContext context;
  context.pool = pool;
  if (const auto workspace = selection::MakeWorkspace(input, context); workspace.ok())
    return touches::Rmse(*(*workspace)->observations,
                         touches::Residuals(*(*workspace)->observations, (*workspace)->nominal));
  const absl::StatusOr<touches::Observations> o = touches::MakeObservations(input);
  if (!o.ok()) return NAN;
  const absl::StatusOr<touches::Prediction> predicted =
      touches::Predict(*o, *input.model, false, false, pool);
  return predicted.ok() ? touches::Rmse(*o, touches::Residuals(*o, *predicted)) : NAN;
}

double RmseAfter(const DiagnosisInput& input, const session::MeasurementFix& fix, ThreadPool* pool) {
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  if (!session::ApplyFix(fix, set.get()).ok()) return NAN;
  DiagnosisInput mended = input;
  mended.set = set;
  return RmseOf(mended, pool);
}

// The command that fixes the file. The server may not know the file's name.
std::string FixCommand(const session::MeasurementFix& fix, const session::MeasurementSet& set) {
  const bool plain = absl::EndsWith(set.origin, ".csv") &&
                     set.origin.find_first_of(" '\"$\\`;&|<>()*?!") == std::string::npos;
  return absl::StrCat("touchstone session fix ", plain ? set.origin : "SET.csv", " ",
                      session::FixOptions(fix, set.fingers), " -o fixed.csv");
}

selection::DataProblem ToProblem(const Mistake& mistake, bool alternative, const DiagnosisInput& input,
                                 double before_s, ThreadPool* pool) {
  selection::DataProblem problem;
  problem.kind = mistake.kind;
  problem.detail = mistake.detail;
  problem.fix = FixCommand(mistake.fix, *input.set);
  problem.rmse_before_s = before_s;
  problem.rmse_after_s = RmseAfter(input, mistake.fix, pool);
  problem.words =
      absl::StrCat(alternative ? "These data cannot tell it from another mistake: " : "It looks as if ",
                   mistake.words, ". With that fixed, the model as it is would be off by ",
                   TimeInWords(problem.rmse_after_s), " instead of ", TimeInWords(before_s), ".");
  return problem;
}

void AddDuplicates(const DiagnosisInput& input, double before_s, ThreadPool* pool,
                   std::vector<selection::DataProblem>* problems) {
  const session::MeasurementSet& set = *input.set;
  const Duplicates duplicates = FindDuplicates(set, *input.model);
  if (duplicates.rows == 0) return;
  session::MeasurementFix fix;
  fix.drop_duplicates = true;
  problems->push_back(
      {"duplicates", absl::StrCat(duplicates.rows, " of ", set.size(), " rows"),
       absl::StrFormat(
           "%d of %d rows repeat an earlier touch to the last digit under another number (the first is "
           "touch %d); no rig repeats like that. Taken for repeats they make the noise look smaller and "
           "everything else too certain.",
           duplicates.rows, set.size(), set.touch[duplicates.example]),
       FixCommand(fix, set), before_s, RmseAfter(input, fix, pool)});
}

void AddSortedColumn(const DiagnosisInput& input, const TrialResult& before, double before_s,
                     std::vector<selection::DataProblem>* problems) {
  if (before.Relative({}) < kSortedMisfit) return;
  const int finger = SortedColumn(input);
  if (finger < 0) return;
  const std::string column = absl::StrCat("t_", model::FingerName(finger, input.set->fingers), "_us");
  problems->push_back(
      {"row_shift", column + " is sorted",
       absl::StrCat("The column ", column,
                    " is sorted from the first row to the last, although the "
                    "model expects it to go up and down: it was sorted without the other columns, and "
                    "each of its times belongs to another touch. Take the file as it was before."),
       "", before_s, NAN});
}

}  // namespace

absl::StatusOr<std::vector<selection::DataProblem>> FindDataProblems(const DiagnosisInput& input,
                                                                     const DiagnosisContext& context) {
  std::vector<selection::DataProblem> problems;
  const absl::StatusOr<touches::Observations> o = touches::MakeObservations(input);
  if (!o.ok() || !input.set->has_poses) return problems;
  const Trial trial(input, SampleRows(*o));
  if (static_cast<int>(trial.rows().size()) < kMinTouches) return problems;
  if (context.progress && !context.progress("checking the data", 0.01))
    return absl::CancelledError("the diagnosis was cancelled");
  const absl::StatusOr<TrialResult> before = trial.Run({});
  if (!before.ok() || before->objects.empty()) return problems;

  std::vector<Mistake> mistakes = MisnamedObjects(trial, *before);
  for (Mistake& mistake : MistakesOfFiles(input.set->fingers, before->speed_m_s))
    mistakes.push_back(std::move(mistake));
  for (Mistake& mistake : OriginsOfBoundingBox(trial)) mistakes.push_back(std::move(mistake));
  std::vector<Tried> tried = TryAll(trial, mistakes, context.pool);
  // A height to be fitted is looked for only where no discrete mistake explains the misfit.
  std::vector<Tried> best = Convincing(tried, *before);
  if (best.empty() && before->ErrorM({}) >= kMinMisfitM) {
    for (Tried& one : TryAll(trial, OffsetOrigins(trial, *before), context.pool))
      tried.push_back(std::move(one));
    best = Convincing(tried, *before);
  }
  const double before_s = RmseOf(input, context.pool);
  for (const Tried& one : best)
    problems.push_back(ToProblem(one.mistake, !problems.empty(), input, before_s, context.pool));
  if (best.empty()) AddSortedColumn(input, *before, before_s, &problems);
  AddDuplicates(input, before_s, context.pool, &problems);
  return problems;
}

}  // namespace touchstone::diagnosis::checks
