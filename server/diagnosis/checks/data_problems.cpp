#include "server/diagnosis/checks/data_problems.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/base/status.h"
#include "server/base/text/readable_time.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/diagnosis/checks/mesh_units.h"
#include "server/diagnosis/checks/object_mistakes.h"
#include "server/diagnosis/checks/part_mistakes.h"
#include "server/diagnosis/checks/rows/duplicates.h"
#include "server/diagnosis/checks/rows/round_speed.h"
#include "server/diagnosis/checks/rows/saturated_times.h"
#include "server/diagnosis/checks/rows/stale_rows.h"
#include "server/diagnosis/checks/rules.h"
#include "server/diagnosis/checks/sampled_set.h"
#include "server/diagnosis/checks/sorted_column.h"
#include "server/diagnosis/checks/tried.h"
#include "server/diagnosis/checks/two_mistakes.h"
#include "server/diagnosis/selection/workspace.h"
#include "server/model/finger_name.h"

namespace touchstone::diagnosis::checks {
namespace {

constexpr char kFixedFile[] = "fixed.csv";

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
  DiagnosisInput corrected = input;
  corrected.set = set;
  return RmseOf(corrected, pool);
}

// The command that fixes the file. The server may not know the file's name.
std::string TouchFixCommand(const session::MeasurementFix& fix, const session::MeasurementSet& set,
                            const std::string& output = kFixedFile) {
  const bool plain = absl::EndsWith(set.origin, ".csv") &&
                     set.origin.find_first_of(" '\"$\\`;&|<>()*?!") == std::string::npos;
  return absl::StrCat("touchstone session fix ", plain ? set.origin : "SET.csv", " ",
                      session::FixOptions(fix, set.fingers), " -o ", output);
}

// Problems are rare, and so is the error of the whole file as it stands: computed where one is told.
class ProblemList {
 public:
  ProblemList(const DiagnosisInput& input, ThreadPool* pool) : input_(input), pool_(pool) {}

  // Mistakes that fit alike: one of them was made.
  void AddAlternatives(const std::vector<Mistake>& mistakes) {
    for (const Mistake& mistake : mistakes) {
      const bool first = &mistake == &mistakes.front();
      Add(mistake, mistake.fix,
          absl::StrCat(first ? "It looks as if " : "These data cannot tell it from another mistake: ",
                       mistake.words));
    }
  }
  // Both were made.
  void AddBoth(const Mistake& one, const Mistake& other) {
    const session::MeasurementFix both = Together(one.fix, other.fix);
    Add(one, both, absl::StrCat("It looks as if there are two mistakes: ", one.words, "; and ", other.words));
    Add(other, both, absl::StrCat("It is the second of two mistakes: ", other.words));
  }
  // One more, of the file that the fixes before have left.
  void AddFurther(const Mistake& mistake, const DiagnosisInput& fixed, const std::string& output) {
    Add(mistake, mistake.fix, absl::StrCat("Besides, in the file that is fixed so far, ", mistake.words),
        fixed, output);
  }
  void AddMeshUnit(const MeshUnit& wrong);
  void AddDuplicates(const touches::Observations& o);
  void AddStaleRows();
  void AddSaturatedTimes(const touches::Observations& o);
  void AddRoundSpeed(const touches::Observations& o);
  void AddSortedColumn(const TrialResult& before);

  bool empty() const { return problems_.empty(); }
  std::vector<engine::DataProblem> Take() { return std::move(problems_); }

 private:
  // Two fixes that have no field in common.
  static session::MeasurementFix Together(const session::MeasurementFix& one,
                                          const session::MeasurementFix& other) {
    session::MeasurementFix both = other;
    if (!one.finger_order.empty()) both.finger_order = one.finger_order;
    both.scale_times *= one.scale_times;
    both.reverse_approach ^= one.reverse_approach;
    both.reverse_lateral ^= one.reverse_lateral;
    return both;
  }
  double BeforeS() {
    if (!before_s_) before_s_ = RmseOf(input_, pool_);
    return *before_s_;
  }
  void Add(const Mistake& mistake, const session::MeasurementFix& fix, const std::string& sentence) {
    Add(mistake, fix, sentence, input_, kFixedFile);
  }
  void Add(const Mistake& mistake, const session::MeasurementFix& fix, const std::string& sentence,
           const DiagnosisInput& input, const std::string& output) {
    engine::DataProblem problem;
    problem.kind = mistake.kind;
    problem.detail = mistake.detail;
    problem.error_before = BeforeS();
    problem.error_after = NAN;
    problem.words = sentence + ".";
    // Touches too scattered to be listed in a command.
    const bool in_part = mistake.part && fix.touches.empty();
    if (!in_part) {
      problem.fix = TouchFixCommand(fix, *input.set, output);
      problem.error_after = RmseAfter(input, fix, pool_);
      absl::StrAppend(&problem.words, " With that fixed, the model as it is would be off by ",
                      TimeInWords(problem.error_after), " instead of ", TimeInWords(BeforeS()), ".");
    }
    problems_.push_back(std::move(problem));
  }

  const DiagnosisInput& input_;
  ThreadPool* pool_;
  std::optional<double> before_s_;
  std::vector<engine::DataProblem> problems_;
};

// The file is right here, so no command fixes it: the option that names the mesh does.
void ProblemList::AddMeshUnit(const MeshUnit& wrong) {
  const std::string meshes = absl::StrJoin(wrong.objects, ", "), factor = FactorInWords(wrong.factor);
  const std::string option = wrong.unit.empty() ? absl::StrCat("scale=", ShortestNumber(wrong.factor))
                                                : absl::StrCat("unit=", wrong.unit);
  const double after_s = RmseOf(wrong.fixed, pool_);
  problems_.push_back(
      {ProblemKind::kUnitsLength, absl::StrCat("mesh of ", meshes, " x ", factor),
       absl::StrCat("It looks as if the mesh of ", meshes, " is in another unit: ", factor,
                    " times as large it fits the touches. Name it as --mesh ", wrong.objects[0], "=FILE,",
                    option, ". Then the model as it is would be off by ", TimeInWords(after_s),
                    " instead of ", TimeInWords(BeforeS()), "."),
       "", BeforeS(), after_s});
}

void ProblemList::AddDuplicates(const touches::Observations& o) {
  const session::MeasurementSet& set = *input_.set;
  const Duplicates duplicates = FindDuplicates(o, *input_.model);
  if (duplicates.rows == 0) return;
  session::MeasurementFix fix;
  fix.drop_duplicates = true;
  problems_.push_back(
      {ProblemKind::kDuplicates, absl::StrCat(duplicates.rows, " of ", set.size(), " rows"),
       absl::StrFormat(
           "%d of %d rows repeat an earlier touch to the last digit under another number (the first is "
           "touch %d); no rig repeats like that. Taken for repeats they make the noise look smaller and "
           "everything else too certain.",
           duplicates.rows, set.size(), set.touch[duplicates.example]),
       TouchFixCommand(fix, set), BeforeS(), RmseAfter(input_, fix, pool_)});
}

void ProblemList::AddStaleRows() {
  const session::MeasurementSet& set = *input_.set;
  const StaleRows stale = FindStaleRows(set);
  if (stale.rows == 0) return;
  session::MeasurementFix fix;
  fix.drop_stale = true;
  const double after_s = RmseAfter(input_, fix, pool_);
  problems_.push_back(
      {ProblemKind::kStaleRows, absl::StrCat(stale.rows, " of ", set.size(), " rows"),
       absl::StrFormat(
           "%d of %d rows hold the times of the row before to the last digit, though they are "
           "touches of another pose (the first is touch %d): the reading was not renewed. Without "
           "them the model as it is would be off by %s instead of %s.",
           stale.rows, set.size(), set.touch[stale.example], TimeInWords(after_s), TimeInWords(BeforeS())),
       TouchFixCommand(fix, set), BeforeS(), after_s});
}

void ProblemList::AddSaturatedTimes(const touches::Observations& o) {
  const absl::StatusOr<touches::Prediction> expected =
      touches::Predict(o, *input_.model, false, false, pool_);
  if (!expected.ok()) return;
  const SaturatedTimes found = FindSaturatedTimes(o, *expected);
  if (found.fingers.empty()) return;
  auto set = std::make_shared<session::MeasurementSet>(*input_.set);
  for (const size_t reading : found.readings) set->time_s[reading] = NAN;
  DiagnosisInput without = input_;
  without.set = set;
  const double after_s = RmseOf(without, pool_);
  std::vector<std::string> names;
  for (const int finger : found.fingers) names.push_back(model::FingerName(finger, set->fingers));
  const std::string time = absl::StrFormat("%.0f us", FromSi(Unit::kMicrosecond, found.time_s));
  const bool all = static_cast<int>(names.size()) == set->fingers;
  problems_.push_back(
      {ProblemKind::kSaturatedTimes,
       absl::StrCat(found.touches, " of ", set->size(), " touches at ", time, all ? "" : " of finger ",
                    all ? "" : absl::StrJoin(names, ", ")),
       absl::StrFormat(
           "%d of %d touches share the largest time %s, %s (the first is touch %d), and the model expects "
           "nearly "
           "all of them later: the times are cut off there, by a counter that stops, a time-out, or the "
           "file. "
           "Record them again with a longer range, or leave those times empty, as contacts that were missed. "
           "Without them the model as it is would be off by %s instead of %s.",
           found.touches, set->size(), all ? "of any finger" : "of finger " + absl::StrJoin(names, " and "),
           time, set->touch[found.example], TimeInWords(after_s), TimeInWords(BeforeS())),
       "", BeforeS(), after_s});
}

void ProblemList::AddRoundSpeed(const touches::Observations& o) {
  const RoundSpeed found = FindRoundSpeed(o);
  if (found.round < 0) return;
  const std::string factor = absl::StrFormat("%.4g", found.factor);
  Mistake mistake{
      ProblemKind::kSpeedFactor,
      absl::StrCat("round ", found.round, " x ", factor),
      absl::StrFormat(
          "round %d was made at %s +- %.1g times the speed that the file says, or its clock ran so "
          "much slower,",
          found.round, factor, found.std_error),
      {},
      {}};
  mistake.fix.scale_speed = found.factor;
  ConfineTo(*input_.set, found.rows, &mistake);
  AddAlternatives({mistake});
}

void ProblemList::AddSortedColumn(const TrialResult& before) {
  // Not the robust error: a column of many zeros is right in most rows, sorted or not.
  double error_s2 = 0, spread_s2 = 0;
  for (const std::optional<TouchError>& touch : before.touches)
    if (touch) error_s2 += touch->error_s2, spread_s2 += touch->spread_s2;
  if (error_s2 < kCheckRules.sorted_misfit * kCheckRules.sorted_misfit * spread_s2) return;
  const int finger = SortedColumn(input_);
  if (finger < 0) return;
  const std::string column = absl::StrCat("t_", model::FingerName(finger, input_.set->fingers), "_us");
  problems_.push_back(
      {ProblemKind::kRowShift, column + " is sorted",
       absl::StrCat("The column ", column,
                    " is sorted from the first row to the last, although the "
                    "model expects it to go up and down: it was sorted without the other columns, and "
                    "each of its times belongs to another touch. Take the file as it was before."),
       "", BeforeS(), NAN});
}

// Most files fit: no mistake that could be claimed leaves so little.
bool NothingToExplain(const TrialResult& before) {
  const double coarse_s =
      kCheckRules.min_misfit_m / std::max(before.speed_m_s, kCheckRules.min_speed_m_s.value());
  const auto wrong = std::count_if(before.touches.begin(), before.touches.end(), [&](const auto& touch) {
    return touch && touch->error_s2 > coarse_s * coarse_s;
  });
  return wrong < kCheckRules.min_wrong && before.Relative({}) < kCheckRules.min_misfit;
}

std::vector<Mistake> MistakesOf(const std::vector<Tried>& tried) {
  std::vector<Mistake> mistakes;
  for (const Tried& one : tried) mistakes.push_back(one.mistake);
  return mistakes;
}

// Parts with mistakes of their own: names that were exchanged in one round are two. Each is looked for in the file
// that the fixes before have left.
void AddFurtherParts(const DiagnosisInput& input, const Mistake& first, ThreadPool* pool,
                     ProblemList* problems) {
  DiagnosisInput fixed = input;
  Mistake last = first;
  for (int further = 2; further <= kCheckRules.max_parts && last.part && !last.fix.touches.empty();
       ++further) {
    auto set = std::make_shared<session::MeasurementSet>(*fixed.set);
    if (!session::ApplyFix(last.fix, set.get()).ok()) return;
    set->origin = further == 2 ? kFixedFile : absl::StrCat("fixed", further - 1, ".csv");
    fixed.set = set;
    const absl::StatusOr<touches::Observations> o = touches::MakeObservations(fixed);
    if (!o.ok()) return;
    const Trial trial(fixed, SampleRows(*o));
    const absl::StatusOr<TrialResult> before = trial.Run({});
    if (!before.ok() || NothingToExplain(*before)) return;
    const std::vector<Mistake> parts =
        PartMistakes(trial, *before, TryAll(trial, AllMistakes(trial, *before), pool));
    if (parts.empty()) return;
    last = parts[0];
    problems->AddFurther(last, fixed, absl::StrCat("fixed", further, ".csv"));
  }
}

absl::Status LookForMistakes(const DiagnosisInput& input, const DiagnosisContext& context, const Trial& trial,
                             const TrialResult& before, ProblemList* problems) {
  std::vector<Tried> tried = TryAll(trial, AllMistakes(trial, before), context.pool);
  std::vector<Mistake> best = MistakesOf(Convincing(tried, before));
  // What takes more trials is looked for only where no single mistake of the whole file explains the misfit: a part
  // of the file, a mesh in another unit, a height to be fitted, two mistakes at once.
  if (best.empty()) best = PartMistakes(trial, before, tried);
  std::optional<MeshUnit> mesh_unit;
  if (best.empty()) mesh_unit = WrongMeshUnit(trial, before);
  if (best.empty() && !mesh_unit && before.ErrorM({}) >= kCheckRules.min_misfit_m) {
    for (Tried& one : TryAll(trial, OffsetOrigins(trial, before), context.pool))
      tried.push_back(std::move(one));
    best = MistakesOf(Convincing(tried, before));
  }
  problems->AddAlternatives(best);
  if (!best.empty()) AddFurtherParts(input, best[0], context.pool, problems);
  if (mesh_unit) {
    problems->AddMeshUnit(*mesh_unit);
  } else if (best.empty()) {
    TOUCHSTONE_RETURN_IF_ERROR(context.Enter("checking the data", 0.02));
    const std::vector<Mistake> two = TwoMistakes(input, trial.rows(), before, context.pool);
    if (two.size() == 2)
      problems->AddBoth(two[0], two[1]);
    else
      problems->AddSortedColumn(before);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<engine::DataProblem>> FindDataProblems(const DiagnosisInput& input,
                                                                  const DiagnosisContext& context) {
  const std::vector<engine::DataProblem> none;
  const absl::StatusOr<touches::Observations> o = touches::MakeObservations(input);
  if (!o.ok() || !input.set->has_poses) return none;
  const Trial trial(input, SampleRows(*o));
  if (static_cast<int>(trial.rows().size()) < kCheckRules.min_touches) return none;
  TOUCHSTONE_RETURN_IF_ERROR(context.Enter("checking the data", 0.01));
  const absl::StatusOr<TrialResult> before = trial.Run({});
  if (!before.ok() || before->objects.empty()) return none;

  ProblemList problems(input, context.pool);
  // Whatever else the file seems to have may be these rows.
  problems.AddStaleRows();
  if (!problems.empty()) return problems.Take();
  problems.AddSaturatedTimes(*o);
  if (!problems.empty()) return problems.Take();
  if (!NothingToExplain(*before)) {
    const absl::Status looked = LookForMistakes(input, context, trial, *before, &problems);
    if (!looked.ok()) return looked;
  }
  problems.AddDuplicates(*o);
  return problems.Take();
}

std::vector<engine::DataProblem> FindRoundAtAnotherSpeed(const DiagnosisInput& input, ThreadPool* pool) {
  const absl::StatusOr<touches::Observations> o = touches::MakeObservations(input);
  if (!o.ok() || !input.set->has_poses) return {};
  ProblemList problems(input, pool);
  problems.AddRoundSpeed(*o);
  return problems.Take();
}

std::vector<engine::DataProblem> FindProblemsOfRows(const DiagnosisInput& input, const std::vector<int>& rows,
                                                    ThreadPool* pool) {
  ProblemList problems(input, pool);
  problems.AddAlternatives(MistakesOfRows(Trial(input, rows), pool));
  return problems.Take();
}

}  // namespace touchstone::diagnosis::checks
