#include "server/diagnosis/checks/part_mistakes.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "server/diagnosis/checks/rules.h"

namespace touchstone::diagnosis::checks {
namespace {

using Ranges = std::vector<std::pair<uint64_t, uint64_t>>;

struct Candidate {
  Mistake mistake;  // of the whole file
  const TrialResult* after = nullptr;
  int object = -1;  // of whose touches it is a part; -1: of all
};

struct Part {
  std::vector<char> wrong;  // of Trial::rows()
  int count = 0, runs = 0;
  double gain_nats = 0;
};

double FineS2(const TrialResult& before) {
  const double fine_s = kCheckRules.fine_m / std::max(before.speed_m_s, kCheckRules.min_speed_m_s.value());
  return fine_s * fine_s;
}

// Log of the relative error. `factor`: of the times.
double CostOf(const TouchError& error, double fine_s2, double factor) {
  const double floor_s2 = fine_s2 * factor * factor;
  return 0.5 * std::log((error.error_s2 + floor_s2) / (error.spread_s2 + floor_s2));
}

bool InScope(const TrialResult& before, const Candidate& candidate, size_t row) {
  const auto &was = before.touches[row], &is = candidate.after->touches[row];
  return was && is && (candidate.object < 0 || was->object == candidate.object);
}

// The division of least cost (Viterbi's algorithm with two states), in the order of the file.
Part Divide(const TrialResult& before, const Candidate& candidate) {
  const size_t rows = before.touches.size();
  const double fine_s2 = FineS2(before), factor = candidate.mistake.fix.scale_times;
  std::vector<std::array<char, 2>> from(rows, {0, 1});
  std::array<double, 2> cost = {0, kCheckRules.change_nats.value()};
  double all_right = 0;
  for (size_t row = 0; row < rows; ++row) {
    if (!InScope(before, candidate, row)) continue;
    const double here[2] = {CostOf(*before.touches[row], fine_s2, 1),
                            CostOf(*candidate.after->touches[row], fine_s2, factor)};
    all_right += here[0];
    const std::array<double, 2> last = cost;
    for (int state = 0; state < 2; ++state) {
      const bool changed = last[1 - state] + kCheckRules.change_nats < last[state];
      from[row][state] = static_cast<char>(changed ? 1 - state : state);
      cost[state] = here[state] + (changed ? last[1 - state] + kCheckRules.change_nats : last[state]);
    }
  }
  Part part;
  part.wrong.assign(rows, 0);
  int state = cost[1] < cost[0] ? 1 : 0;
  part.gain_nats = all_right - cost[state];
  for (size_t row = rows; row-- > 0;) {
    if (!InScope(before, candidate, row)) continue;
    part.wrong[row] = static_cast<char>(state);
    part.count += state;
    const int previous = from[row][state];
    part.runs += state == 1 && previous == 0;
    state = previous;
  }
  return part;
}

// Rows of one object that follow each other were touched in one go: where nearly all of them are wrong, those that
// cannot be told are too, and where hardly any is, none is. `part`: of all rows of the set.
void RoundToBlocks(const session::MeasurementSet& set, Part* part) {
  for (int begin = 0, end = 0; begin < set.size(); begin = end) {
    for (end = begin; end < set.size() && set.object[end] == set.object[begin];) ++end;
    const auto first = part->wrong.begin() + begin, last = part->wrong.begin() + end;
    const auto wrong = std::count(first, last, 1);
    if (end - begin < kCheckRules.min_block || wrong == 0) continue;
    if (wrong >= kCheckRules.nearly_all * (end - begin)) std::fill(first, last, 1);
    if (wrong <= (1 - kCheckRules.nearly_all) * (end - begin)) std::fill(first, last, 0);
  }
  part->count = static_cast<int>(std::count(part->wrong.begin(), part->wrong.end(), 1));
}

double RelativeOf(const ObjectError& error) {
  return error.spread_s2 > 0 ? std::sqrt(error.error_s2 / error.spread_s2) : 0;
}

bool ScaleOfPartIsRight(const Mistake& mistake, const std::vector<TouchError>& part) {
  double product = 0, square = 0, error_s2 = 0;
  for (const TouchError& touch : part)
    product += touch.product_s2, square += touch.predicted_s2, error_s2 += touch.error_s2;
  if (!(square > 0)) return !ChangesScale(mistake);
  return ScaleIsRight(mistake, product / square,
                      std::sqrt(error_s2 / static_cast<double>(part.size()) / square));
}

bool PartIsClaimable(const TrialResult& before, const Candidate& candidate, const Part& part) {
  std::vector<TouchError> part_before, part_after, rest_before, rest_after, others;
  for (size_t row = 0; row < before.touches.size(); ++row) {
    if (!before.touches[row]) continue;
    const bool in_scope = InScope(before, candidate, row);
    if (part.wrong[row]) {
      part_before.push_back(*before.touches[row]);
      part_after.push_back(*candidate.after->touches[row]);
    } else if (in_scope) {
      rest_before.push_back(*before.touches[row]);
      rest_after.push_back(*candidate.after->touches[row]);
    } else {
      others.push_back(*before.touches[row]);
    }
  }
  if (static_cast<int>(part_before.size()) < kCheckRules.min_part ||
      static_cast<int>(rest_before.size() + others.size()) < kCheckRules.min_part ||
      part.runs * kCheckRules.min_run > part.count || !ScaleOfPartIsRight(candidate.mistake, part_after))
    return false;
  const ObjectError was = RobustError(part_before), is = RobustError(part_after);
  const double misfit_m = std::sqrt(was.error_s2) * before.speed_m_s;
  if (!ChangesScale(candidate.mistake) && misfit_m < kCheckRules.min_misfit_m) return false;
  if (RelativeOf(is) > kCheckRules.max_left ||
      RelativeOf(is) > kCheckRules.max_ratio * std::min(RelativeOf(was), kCheckRules.max_before.value()))
    return false;
  // Where the touches of the same object are right as they stand, the fix must make them worse.
  if (static_cast<int>(rest_before.size()) >= kCheckRules.min_part &&
      RelativeOf(RobustError(rest_after)) < kCheckRules.rest_worse * RelativeOf(RobustError(rest_before)))
    return false;
  rest_before.insert(rest_before.end(), others.begin(), others.end());
  return RelativeOf(RobustError(rest_before)) <= kCheckRules.max_rest_error;
}

// The touches of these rows as ranges of their numbers, none of which holds another touch.
Ranges RangesOf(const session::MeasurementSet& set, const std::vector<char>& wrong_row) {
  std::vector<int> rows(set.size());
  std::iota(rows.begin(), rows.end(), 0);
  std::sort(rows.begin(), rows.end(), [&](int a, int b) { return set.touch[a] < set.touch[b]; });
  Ranges ranges;
  bool open = false;
  for (const int row : rows) {
    if (wrong_row[row] && open) ranges.back().second = set.touch[row];
    if (wrong_row[row] && !open) ranges.emplace_back(set.touch[row], set.touch[row]);
    open = wrong_row[row];
  }
  return ranges;
}

std::string InWords(const Ranges& ranges) {
  std::vector<std::string> texts;
  for (size_t r = 0; r < std::min(ranges.size(), kCheckRules.ranges_in_words.value()); ++r)
    texts.push_back(ranges[r].first == ranges[r].second
                        ? absl::StrCat(ranges[r].first)
                        : absl::StrCat(ranges[r].first, " to ", ranges[r].second));
  return absl::StrCat("touches ", absl::StrJoin(texts, ", "),
                      ranges.size() > kCheckRules.ranges_in_words ? ", ..." : "");
}

// Mistakes of whole files, and each object under the name of each other mesh.
std::vector<Candidate> Candidates(const Trial& trial, const std::vector<Tried>& tried,
                                  std::vector<Tried>* renamed) {
  const std::vector<std::string>& objects = trial.input().set->objects;
  std::vector<Candidate> candidates;
  for (const auto& [mesh, surface] : trial.input().surfaces) {
    Tried one;
    for (const std::string& object : objects)
      if (object != mesh) one.mistake.fix.rename_objects.emplace_back(object, mesh);
    absl::StatusOr<TrialResult> after = trial.Run(one.mistake.fix);
    if (!after.ok()) continue;
    one.after = *std::move(after);
    one.mistake.detail = mesh;
    renamed->push_back(std::move(one));
  }
  for (const Tried& one : *renamed)
    for (size_t object = 0; object < objects.size(); ++object) {
      const std::string& mesh = one.mistake.detail;
      if (objects[object] == mesh) continue;
      const bool known = std::find(objects.begin(), objects.end(), mesh) != objects.end();
      Candidate candidate{{known ? ProblemKind::kObjectNames : ProblemKind::kWrongMesh,
                           absl::StrCat(objects[object], " is ", mesh),
                           "",
                           {},
                           {objects[object]}},
                          &one.after,
                          static_cast<int>(object)};
      candidate.mistake.fix.rename_objects = {{objects[object], mesh}};
      candidates.push_back(std::move(candidate));
    }
  for (const Tried& one : tried) {
    if (!one.mistake.fix.rename_objects.empty()) continue;
    candidates.push_back({one.mistake, &one.after, -1});
    for (size_t object = 0; object < objects.size() && objects.size() > 1; ++object)
      candidates.push_back({one.mistake, &one.after, static_cast<int>(object)});
  }
  return candidates;
}

// The part on all rows of the file, in words and as a fix; false: on all rows it is none.
bool Complete(const Trial& trial, Candidate candidate, Mistake* mistake) {
  const session::MeasurementSet& set = *trial.input().set;
  std::vector<int> rows(set.size());
  std::iota(rows.begin(), rows.end(), 0);
  const Trial whole(trial.input(), rows);
  const absl::StatusOr<TrialResult> before = whole.Run({}), after = whole.Run(candidate.mistake.fix);
  if (!before.ok() || !after.ok()) return false;
  candidate.after = &*after;
  Part part = Divide(*before, candidate);
  if (!PartIsClaimable(*before, candidate, part)) return false;
  RoundToBlocks(set, &part);
  *mistake = candidate.mistake;
  mistake->part = true;
  const Ranges ranges = RangesOf(set, part.wrong);
  if (ranges.size() <= kCheckRules.max_ranges) mistake->fix.touches = ranges;
  int of = set.size();
  const auto& renames = candidate.mistake.fix.rename_objects;
  if (candidate.object >= 0)
    of = static_cast<int>(std::count(set.object.begin(), set.object.end(), candidate.object));
  const std::string name = candidate.object >= 0 ? set.objects[candidate.object] : "";
  absl::StrAppend(&mistake->detail, ", ", InWords(ranges));
  if (!renames.empty())
    mistake->words = absl::StrCat(part.count, " of the ", of, " touches that the file calls ", name,
                                  " were touches of ", renames[0].second, " (", InWords(ranges), ")");
  else
    absl::StrAppend(&mistake->words, " in ", part.count, " of the ", of, " touches",
                    name.empty() ? "" : absl::StrCat(" of ", name), " alone (", InWords(ranges), ")");
  return true;
}

}  // namespace

void ConfineTo(const session::MeasurementSet& set, const std::vector<int>& rows, Mistake* mistake) {
  std::vector<char> wrong(set.size(), 0);
  for (const int row : rows) wrong[row] = 1;
  mistake->part = true;
  const Ranges ranges = RangesOf(set, wrong);
  if (ranges.size() <= kCheckRules.max_ranges) mistake->fix.touches = ranges;
  absl::StrAppend(&mistake->detail, ", ", InWords(ranges));
  absl::StrAppend(&mistake->words, " in ", rows.size(), " of the ", set.size(), " touches alone (",
                  InWords(ranges), ")");
}

std::vector<Mistake> MistakesOfRows(const Trial& trial, ThreadPool* pool) {
  const absl::StatusOr<TrialResult> before = trial.Run({});
  if (!before.ok() || static_cast<int>(trial.rows().size()) < kCheckRules.min_part) return {};
  std::vector<Mistake> found;
  for (Tried& one : Convincing(TryAll(trial, AllMistakes(trial, *before), pool), *before)) {
    ConfineTo(*trial.input().set, trial.rows(), &one.mistake);
    found.push_back(std::move(one.mistake));
  }
  return found;
}

std::vector<Mistake> PartMistakes(const Trial& trial, const TrialResult& before,
                                  const std::vector<Tried>& tried) {
  const double coarse_s =
      kCheckRules.min_misfit_m / std::max(before.speed_m_s, kCheckRules.min_speed_m_s.value());
  const auto wrong = std::count_if(before.touches.begin(), before.touches.end(), [&](const auto& touch) {
    return touch && touch->error_s2 > coarse_s * coarse_s;
  });
  if (wrong < kCheckRules.min_part) return {};
  std::vector<Tried> renamed;
  std::vector<std::pair<double, Candidate>> claimable;
  for (const Candidate& candidate : Candidates(trial, tried, &renamed)) {
    const Part part = Divide(before, candidate);
    if (part.count < kCheckRules.min_part || !PartIsClaimable(before, candidate, part)) continue;
    claimable.emplace_back(part.gain_nats, candidate);
  }
  std::stable_sort(claimable.begin(), claimable.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<Mistake> found;
  for (const auto& [gain_nats, candidate] : claimable) {
    if (gain_nats < kCheckRules.same_gain * claimable[0].first || found.size() == kCheckRules.max_named)
      break;
    const bool again = std::any_of(found.begin(), found.end(),
                                   [kind = candidate.mistake.kind](const auto& m) { return m.kind == kind; });
    Mistake mistake;
    if (!again && Complete(trial, candidate, &mistake)) found.push_back(std::move(mistake));
  }
  return found;
}

}  // namespace touchstone::diagnosis::checks
