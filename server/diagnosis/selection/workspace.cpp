#include "server/diagnosis/selection/workspace.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/selection/rules.h"

namespace touchstone::diagnosis::selection {
namespace {

// A mesh that most touches miss is not the mesh that was touched.
absl::Status CheckMeshes(const touches::Observations& o, const touches::Prediction& nominal,
                         std::vector<std::string>* warnings) {
  std::vector<int> touches(o.objects.size()), missed(o.objects.size());
  std::vector<double> off_m(o.objects.size());
  for (int k = 0; k < o.size(); ++k) {
    if (!o.used[k]) continue;
    ++touches[o.object[k]];
    bool misses = false;
    for (size_t e = static_cast<size_t>(k) * o.fingers; e < static_cast<size_t>(k + 1) * o.fingers; ++e)
      misses |= !std::isnan(o.time_s[e]) &&
                !(nominal.travel_m[e] < kSelectionRules.max_travel * o.set->standoff_m[o.row[k]]);
    missed[o.object[k]] += misses;
    const geometry::Bounds& bounds = o.surfaces[o.object[k]]->bounds();
    const Eigen::Vector3d& target = o.set->target_m[o.row[k]];
    const Eigen::Vector3d outside = (bounds.min_m - target).cwiseMax(target - bounds.max_m).cwiseMax(0.0);
    off_m[o.object[k]] = std::max(off_m[o.object[k]], outside.norm());
  }
  for (size_t object = 0; object < o.objects.size(); ++object) {
    if (touches[object] == 0 || missed[object] <= kSelectionRules.warn_missed * touches[object]) continue;
    const geometry::Bounds& bounds = o.surfaces[object]->bounds();
    const Eigen::Vector3d size_mm = (bounds.max_m - bounds.min_m) * kMillimetresPerMetre;
    const std::string text = absl::StrFormat(
        "object '%s': in %d of %d touches a finger reported that in the model misses the mesh or meets it "
        "far behind the target. The mesh measures %.4g x %.4g x %.4g mm%s",
        o.objects[object], missed[object], touches[object], size_mm.x(), size_mm.y(), size_mm.z(),
        off_m[object] > kSelectionRules.outside
            ? absl::StrFormat(", and targets lie up to %.3g mm outside of it",
                              off_m[object] * kMillimetresPerMetre)
            : "; every target lies within it");
    if (missed[object] > kSelectionRules.max_missed * touches[object])
      return absl::InvalidArgumentError(absl::StrCat(o.set->origin, ": ", text,
                                                     ". Is it this object's mesh, in mm, with z up? (--mesh ",
                                                     o.objects[object], "=FILE,unit=mm,up=z)"));
    warnings->push_back(text + ".");
  }
  return absl::OkStatus();
}

// Times a thousand times too long or too short: no effect does that, a wrong unit does.
absl::Status CheckUnits(const touches::Observations& o, const touches::Prediction& nominal) {
  std::vector<double> measured, predicted;
  for (int k = 0; k < o.size(); ++k) {
    double min_s = INFINITY, max_s = -INFINITY, min_p = INFINITY, max_p = -INFINITY;
    for (size_t e = static_cast<size_t>(k) * o.fingers; e < static_cast<size_t>(k + 1) * o.fingers; ++e) {
      if (std::isnan(o.time_s[e]) || std::isnan(nominal.time_s[e])) continue;
      min_s = std::min(min_s, o.time_s[e]), max_s = std::max(max_s, o.time_s[e]);
      min_p = std::min(min_p, nominal.time_s[e]), max_p = std::max(max_p, nominal.time_s[e]);
    }
    if (max_s < min_s) continue;
    measured.push_back(max_s - min_s);
    predicted.push_back(max_p - min_p);
  }
  if (measured.empty()) return absl::OkStatus();
  const auto median = [](std::vector<double>* values) {
    std::nth_element(values->begin(), values->begin() + values->size() / 2, values->end());
    return (*values)[values->size() / 2];
  };
  const double m = median(&measured), p = median(&predicted);
  if (!(m > 0 && p > 0) || (m < kSelectionRules.unit_factor * p && p < kSelectionRules.unit_factor * m))
    return absl::OkStatus();
  const double speed_mm_s = o.set->speed_m_s[0] * kMillimetresPerMetre;
  return absl::InvalidArgumentError(absl::StrFormat(
      "%s: the fingers' times differ by %.3g us in a typical touch, but at %.4g mm/s the model expects %.3g "
      "us: no effect makes a factor of %.3g. t_*_us are microseconds, speed_mm_s is mm/s; does the file have "
      "%s?",
      o.set->origin, m * kMicrosecondsPerSecond, speed_mm_s, p * kMicrosecondsPerSecond,
      m > p ? m / p : p / m,
      m < p ? "milliseconds (multiply by 1000) or seconds" : "nanoseconds, or speeds in m/s"));
}

// A part of the observations; `previous` stays within it.
touches::Observations Thin(const touches::Observations& o, const std::vector<int>& kept) {
  touches::Observations part;
  part.set = o.set;
  part.fingers = o.fingers;
  part.objects = o.objects;
  part.surfaces = o.surfaces;
  std::map<int, int> poses;
  std::vector<int> now(o.size(), -1);
  for (const int k : kept) {
    now[k] = part.size();
    part.row.push_back(o.row[k]);
    part.object.push_back(o.object[k]);
    part.pose.push_back(poses.emplace(o.pose[k], static_cast<int>(poses.size())).first->second);
    part.used.push_back(o.used[k]);
    part.previous.push_back(o.previous[k] >= 0 ? now[o.previous[k]] : -1);
    part.time_s.insert(part.time_s.end(), o.time_s.begin() + static_cast<size_t>(k) * o.fingers,
                       o.time_s.begin() + static_cast<size_t>(k + 1) * o.fingers);
  }
  part.poses = static_cast<int>(poses.size());
  return part;
}

}  // namespace

void LeaveOutMissed(const touches::Prediction& prediction, touches::Observations* o) {
  for (int k = 0; k < o->size(); ++k) {
    int members = 0;
    for (size_t e = static_cast<size_t>(k) * o->fingers; e < static_cast<size_t>(k + 1) * o->fingers; ++e)
      members += !std::isnan(o->time_s[e]) && !std::isnan(prediction.time_s[e]);
    if (members < 2) touches::LeaveOut(o, k, touches::kMissedReason);
  }
}

absl::StatusOr<int> LeaveOutEdges(const touches::Predictor& predictor, const model::Model& model,
                                  touches::Observations* o) {
  std::vector<std::vector<double>> travels;
  for (const auto& [x, y] :
       {std::pair(0.0, 0.0), std::pair(kSelectionRules.edge.value(), 0.0),
        std::pair(-kSelectionRules.edge.value(), 0.0), std::pair(0.0, kSelectionRules.edge.value()),
        std::pair(0.0, -kSelectionRules.edge.value())}) {
    TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<double> travel, predictor.TravelWhenMoved(model, x, y));
    travels.push_back(std::move(travel));
  }
  int left_out = 0;
  for (int k = 0; k < o->size(); ++k) {
    if (!o->used[k]) continue;
    bool edge = false;
    for (size_t e = static_cast<size_t>(k) * o->fingers; e < static_cast<size_t>(k + 1) * o->fingers; ++e) {
      if (std::isnan(o->time_s[e]) || std::isnan(travels[0][e])) continue;
      for (const int axis : {1, 3}) {
        const double bend = travels[axis][e] + travels[axis + 1][e] - 2 * travels[0][e];
        edge |= !(std::abs(bend) < kSelectionRules.edge_jump);
      }
    }
    if (!edge) continue;
    touches::LeaveOut(o, k, touches::kEdgeReason);
    ++left_out;
  }
  return left_out;
}

touches::SumOfSquares PureErrorOf(const touches::Observations& o, const std::vector<double>& residuals) {
  // Groups of one pose and one set of reporting fingers: sums of residuals and of squares.
  struct Group {
    int touches = 0, members = 0;
    std::vector<double> sum;
    double squares = 0;
  };
  std::map<std::pair<int, uint32_t>, Group> groups;
  for (int k = 0; k < o.size(); ++k) {
    if (!o.used[k]) continue;
    uint32_t mask = 0;
    int members = 0;
    const double* r = &residuals[static_cast<size_t>(k) * o.fingers];
    for (int i = 0; i < o.fingers; ++i)
      if (!std::isnan(r[i])) mask |= 1u << i, ++members;
    if (members < 2) continue;
    Group& group = groups[{o.pose[k], mask}];
    group.sum.resize(o.fingers);
    group.members = members;
    ++group.touches;
    for (int i = 0; i < o.fingers; ++i)
      if (!std::isnan(r[i])) group.sum[i] += r[i], group.squares += r[i] * r[i];
  }
  touches::SumOfSquares error;
  for (const auto& [key, group] : groups) {
    double mean_squares = 0;
    for (const double sum : group.sum) mean_squares += sum * sum / group.touches;
    error.sum_of_squares += std::max(group.squares - mean_squares, 0.0);  // equal repeats: rounding
    error.degrees_of_freedom += static_cast<double>(group.members - 1) * (group.touches - 1);
  }
  return error;
}

namespace {

// How many repeats of one pose the search may see, so that all poses together stay within kSelectionRules.max_searched; never fewer
// than kSelectionRules.min_repeats. `usable`: touches per pose.
int MaxRepeats(const std::vector<int>& usable) {
  int repeats = kSelectionRules.min_repeats;
  const auto total = [&](int limit) {
    return std::accumulate(usable.begin(), usable.end(), int64_t{0},
                           [limit](int64_t sum, int count) { return sum + std::min(count, limit); });
  };
  const int most = usable.empty() ? 0 : *std::max_element(usable.begin(), usable.end());
  while (repeats < most && total(repeats + 1) <= kSelectionRules.max_searched) ++repeats;
  return repeats;
}

// Repeats of every pose if so many fit, else of poses spread evenly over the set. Of each pose they are spread evenly
// over its repeats: what the first hours do not show, drift for one, the whole session does. [k]
std::vector<char> ChooseTouches(const touches::Observations& o) {
  std::vector<int> usable(o.poses, 0);
  for (int k = 0; k < o.size(); ++k) usable[o.pose[k]] += o.used[k];
  const int max_repeats = MaxRepeats(usable);
  int total = 0;
  for (const int count : usable) total += std::min(count, max_repeats);
  const double stride = std::max(1.0, static_cast<double>(total) / kSelectionRules.max_searched);
  std::vector<int> quota(o.poses, 0), seen(o.poses, 0);
  double credit = 0;
  for (int pose = 0; pose < o.poses; ++pose) {
    const int wanted = std::min(usable[pose], max_repeats);
    credit += wanted;
    if (wanted == 0 || credit < stride * wanted) continue;
    credit -= stride * wanted;
    quota[pose] = wanted;
  }
  std::vector<char> chosen(o.size(), 0);
  for (int k = 0; k < o.size(); ++k) {
    const int pose = o.pose[k];
    if (!o.used[k] || quota[pose] == 0) continue;
    // The repeat in the middle of each of `quota` equal parts. Poses with as many repeats have the same rounds chosen.
    const int64_t repeat = seen[pose]++, count = usable[pose];
    const auto middles_before = [&](int64_t at) { return (2 * at * quota[pose] + count) / (2 * count); };
    chosen[k] = middles_before(repeat + 1) > middles_before(repeat);
  }
  return chosen;
}

// The touches that the search sees; of large sets a part, with the touch before each, which hysteresis feels.
touches::Observations SearchedOf(const touches::Observations& o, bool thinned) {
  std::vector<int> kept;
  if (!thinned) {
    for (int k = 0; k < o.size(); ++k) kept.push_back(k);
    return Thin(o, kept);
  }
  const std::vector<char> chosen = ChooseTouches(o);
  std::vector<char> needed(o.size(), 0);
  for (int k = 0; k < o.size(); ++k)
    if (chosen[k] && o.previous[k] >= 0) needed[o.previous[k]] = 1;
  for (int k = 0; k < o.size(); ++k)
    if (chosen[k] || needed[k]) kept.push_back(k);
  touches::Observations searched = Thin(o, kept);
  for (size_t j = 0; j < kept.size(); ++j)
    if (!chosen[kept[j]]) searched.used[j] = 0;
  return searched;
}

}  // namespace

touches::Contrasts WeighedContrasts(const Workspace& workspace, const touches::Observations& o,
                                    const std::vector<double>& expected_s) {
  touches::Contrasts contrasts(o, expected_s);
  if (workspace.weights_by_row.empty()) return contrasts;
  std::vector<double> weights;
  for (const int k : contrasts.touches()) weights.push_back(workspace.weights_by_row[o.row[k]]);
  contrasts.SetWeights(weights);
  return contrasts;
}

absl::Status PrepareSearch(Workspace* workspace, const std::vector<double>& weights_by_row) {
  const touches::Observations& o = *workspace->observations;
  workspace->thinned = o.size() > kSelectionRules.max_searched;
  workspace->searched = std::make_unique<touches::Observations>(SearchedOf(o, workspace->thinned));
  workspace->searched_predictor = std::make_unique<touches::Predictor>(*workspace->searched, nullptr);
  TOUCHSTONE_ASSIGN_OR_RETURN(workspace->searched_nominal,
                              workspace->searched_predictor->Run(*workspace->input.model, true, false));
  const touches::Observations& searched = *workspace->searched;
  workspace->weights_by_row = weights_by_row;
  workspace->contrasts = std::make_unique<touches::Contrasts>(
      WeighedContrasts(*workspace, searched, workspace->searched_nominal.time_s));
  double slope = 0;  // s/m
  for (const int k : workspace->contrasts->touches()) slope += 1 / searched.set->speed_m_s[searched.row[k]];
  slope /= std::max<size_t>(workspace->contrasts->touches().size(), 1);
  const engine::SmoothErrorGeometry geometry =
      touches::SurfaceErrorGeometry(searched, *workspace->contrasts, workspace->searched_nominal);
  workspace->likelihood = std::make_unique<engine::Likelihood>(
      touches::FirstRowsOfObjects(*workspace->contrasts, static_cast<int>(searched.objects.size())),
      &geometry, kSelectionRules.rounding * slope, workspace->context.pool);
  workspace->rows = std::make_unique<touches::TouchObservationModel>(
      searched, *workspace->searched_predictor, *workspace->contrasts, workspace->searched_nominal.time_s);
  engine::Experiment& experiment = workspace->experiment;
  experiment.observations = workspace->rows.get();
  experiment.likelihood = workspace->likelihood.get();
  experiment.pool = workspace->context.pool;
  experiment.settled = workspace->input.settled;
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<Workspace>> MakeWorkspace(const DiagnosisInput& input,
                                                         const DiagnosisContext& context) {
  auto workspace = std::make_unique<Workspace>();
  workspace->input = input;
  workspace->context = context;
  TOUCHSTONE_RETURN_IF_ERROR(context.Enter("reading", 0));
  TOUCHSTONE_ASSIGN_OR_RETURN(touches::Observations observations, touches::MakeObservations(input));
  workspace->observations = std::make_unique<touches::Observations>(std::move(observations));
  touches::Observations& o = *workspace->observations;
  workspace->predictor = std::make_unique<touches::Predictor>(o, context.pool);
  workspace->comparable = o.used;
  TOUCHSTONE_RETURN_IF_ERROR(context.Enter("predicting", 0.02));
  TOUCHSTONE_ASSIGN_OR_RETURN(workspace->nominal, workspace->predictor->Run(*input.model, true, true));
  TOUCHSTONE_RETURN_IF_ERROR(CheckMeshes(o, workspace->nominal, &workspace->warnings));
  TOUCHSTONE_RETURN_IF_ERROR(CheckUnits(o, workspace->nominal));
  LeaveOutMissed(workspace->nominal, &o);
  TOUCHSTONE_RETURN_IF_ERROR(LeaveOutEdges(*workspace->predictor, *input.model, &o).status());
  return workspace;
}

}  // namespace touchstone::diagnosis::selection
