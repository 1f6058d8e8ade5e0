#include "server/diagnosis/residuals/touches/groups.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "server/base/units.h"
#include "server/diagnosis/residuals/slices/covariates.h"
#include "server/diagnosis/residuals/touches/rules.h"

namespace touchstone::diagnosis::residuals {
namespace {

struct GroupSums {
  std::string name;
  double touches = 0, fingers = 0, dof = 0, sum = 0, squares = 0, excess = 0;  // of residuals: s, s^2
};

// Index of every number among the distinct ones, in their order; returns an empty group for each.
std::vector<GroupSums> Levels(const std::vector<double>& values, std::vector<int>* level,
                              const std::function<std::string(double)>& name) {
  std::vector<double> distinct = values;
  std::sort(distinct.begin(), distinct.end());
  distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
  std::vector<GroupSums> groups(distinct.size());
  for (size_t g = 0; g < distinct.size(); ++g) groups[g].name = name(distinct[g]);
  level->resize(values.size());
  for (size_t k = 0; k < values.size(); ++k)
    (*level)[k] =
        static_cast<int>(std::lower_bound(distinct.begin(), distinct.end(), values[k]) - distinct.begin());
  return groups;
}

std::string WholeNumber(double value) {
  return absl::StrCat(static_cast<int>(value));
}

class ErrorGrouper {
 public:
  ErrorGrouper(const touches::Observations& observations, const std::vector<double>& residuals,
               double sigma_s);
  GroupedErrors Group();

 private:
  void Add(size_t n, int only_finger, GroupSums* group) const;
  void Report(ErrorGroupKind kind, const std::vector<GroupSums>& groups);
  // Every counted touch n goes into groups[level[n]].
  void ByLevel(ErrorGroupKind kind, std::vector<GroupSums> groups, const std::vector<int>& level);
  void ByNumber(ErrorGroupKind kind, const std::vector<double>& values,
                const std::function<std::string(double)>& name);
  std::vector<GroupSums> ByFinger();
  void ByTime();
  // A value of every counted touch, from its row of the set.
  template <typename Value>
  std::vector<double> Column(Value value) const {
    std::vector<double> values(touches_.size());
    for (size_t n = 0; n < touches_.size(); ++n) values[n] = value(observations_.row[touches_[n]]);
    return values;
  }

  const touches::Observations& observations_;
  const std::vector<double>& residuals_;
  const double sigma_s_;
  std::vector<int> touches_, compared_;  // the touches that count, and how many fingers of each
  double all_excess_ = 0;
  GroupedErrors result_;
};

ErrorGrouper::ErrorGrouper(const touches::Observations& observations, const std::vector<double>& residuals,
                           double sigma_s)
    : observations_(observations), residuals_(residuals), sigma_s_(sigma_s) {
  for (int k = 0; k < observations.size(); ++k) {
    const int count = FingersCompared(observations, residuals, k);
    if (!observations.used[k] || count < 2) continue;
    touches_.push_back(k);
    compared_.push_back(count);
  }
}

void ErrorGrouper::Add(size_t n, int only_finger, GroupSums* group) const {
  const double* const residual_s = &residuals_[size_t(touches_[n]) * observations_.fingers];
  ++group->touches;
  // A finger's share of a touch's degrees of freedom, so that the group's RMSE compares with the whole set's.
  const double dof_per_finger = 1 - 1.0 / compared_[n];
  for (int i = 0; i < observations_.fingers; ++i) {
    if (std::isnan(residual_s[i]) || (only_finger >= 0 && i != only_finger)) continue;
    group->fingers += 1;
    group->dof += dof_per_finger;
    group->sum += residual_s[i];
    group->squares += residual_s[i] * residual_s[i];
    group->excess += residual_s[i] * residual_s[i] - NoiseShare(sigma_s_, compared_[n]);
  }
}

void ErrorGrouper::Report(ErrorGroupKind kind, const std::vector<GroupSums>& groups) {
  if (groups.size() > kTouchResidualRules.max_groups) return;
  for (const GroupSums& group : groups) {
    if (group.touches == 0 || group.dof == 0) continue;
    ErrorGroup reported;
    reported.kind = kind;
    reported.name = group.name;
    reported.touches = static_cast<int>(group.touches);
    reported.rmse_s = std::sqrt(group.squares / group.dof);
    reported.mean_residual_s = group.sum / group.fingers;
    reported.share_of_excess_error = all_excess_ > 0 ? std::clamp(group.excess / all_excess_, 0.0, 1.0) : 0;
    result_.groups.push_back(std::move(reported));
  }
}

void ErrorGrouper::ByLevel(ErrorGroupKind kind, std::vector<GroupSums> groups,
                           const std::vector<int>& level) {
  for (size_t n = 0; n < touches_.size(); ++n) Add(n, -1, &groups[level[n]]);
  Report(kind, groups);
}

void ErrorGrouper::ByNumber(ErrorGroupKind kind, const std::vector<double>& values,
                            const std::function<std::string(double)>& name) {
  std::vector<int> level;
  std::vector<GroupSums> groups = Levels(values, &level, name);
  ByLevel(kind, std::move(groups), level);
}

// The fingers' excess adds up to the whole set's.
std::vector<GroupSums> ErrorGrouper::ByFinger() {
  std::vector<GroupSums> fingers(observations_.fingers);
  for (int i = 0; i < observations_.fingers; ++i) {
    fingers[i].name = model::FingerName(i, observations_.fingers);
    for (size_t n = 0; n < touches_.size(); ++n)
      if (!std::isnan(residuals_[size_t(touches_[n]) * observations_.fingers + i])) Add(n, i, &fingers[i]);
    all_excess_ += fingers[i].excess;
    result_.finger_bias_s.push_back(fingers[i].fingers ? fingers[i].sum / fingers[i].fingers : 0);
  }
  return fingers;
}

// Parts of the session of equal length.
void ErrorGrouper::ByTime() {
  if (!observations_.set->has_session_time || touches_.empty()) return;
  const std::vector<double> time_s = Column([&](int row) { return observations_.set->session_time_s[row]; });
  const auto [begin, end] = std::minmax_element(time_s.begin(), time_s.end());
  const double part_s = (*end - *begin) / kTouchResidualRules.time_bins;
  if (!(part_s > 0)) return;
  std::vector<GroupSums> parts(kTouchResidualRules.time_bins.value());
  for (int p = 0; p < kTouchResidualRules.time_bins; ++p)
    parts[p].name = absl::StrCat(std::lround((*begin + p * part_s) / 60), " to ",
                                 std::lround((*begin + (p + 1) * part_s) / 60), " min");
  std::vector<int> part(touches_.size());
  for (size_t n = 0; n < touches_.size(); ++n)
    part[n] = std::min(kTouchResidualRules.time_bins - 1, static_cast<int>((time_s[n] - *begin) / part_s));
  ByLevel(ErrorGroupKind::kTime, std::move(parts), part);
}

GroupedErrors ErrorGrouper::Group() {
  const session::MeasurementSet& set = *observations_.set;
  const std::vector<GroupSums> fingers = ByFinger();

  std::vector<GroupSums> objects(observations_.objects.size());
  std::vector<int> object(touches_.size());
  for (size_t o = 0; o < objects.size(); ++o) objects[o].name = observations_.objects[o];
  for (size_t n = 0; n < touches_.size(); ++n) object[n] = observations_.object[touches_[n]];
  ByLevel(ErrorGroupKind::kObject, std::move(objects), object);
  if (!set.face.empty())
    ByNumber(ErrorGroupKind::kFace, Column([&](int row) { return set.face[row]; }), WholeNumber);
  Report(ErrorGroupKind::kFinger, fingers);
  if (!set.round.empty())
    ByNumber(ErrorGroupKind::kRound, Column([&](int row) { return set.round[row]; }), WholeNumber);
  ByTime();
  // Speeds that differ by less than a nanometre per second are one; the groups' names are in mm/s.
  ByNumber(ErrorGroupKind::kSpeed,
           Column([&](int row) { return std::round(set.speed_m_s[row] * 1e9) * 1e-6; }),
           [](double mm_s) { return absl::StrCat(mm_s, " mm/s"); });
  return std::move(result_);
}

}  // namespace

GroupedErrors GroupErrors(const touches::Observations& observations, const std::vector<double>& residuals,
                          double sigma_s) {
  return ErrorGrouper(observations, residuals, sigma_s).Group();
}

}  // namespace touchstone::diagnosis::residuals
