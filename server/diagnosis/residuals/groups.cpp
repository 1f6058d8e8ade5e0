// Errors by object, face, finger, round, time and speed; the worst touches; the bias of each finger.
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/text.h"
#include "server/base/units.h"
#include "server/diagnosis/residuals/covariates.h"
#include "server/diagnosis/residuals/describe_residuals.h"

namespace touchstone {
namespace {

constexpr int kTimeBins = 8;
constexpr size_t kMaxGroups = 200;  // of one kind
constexpr size_t kWorstTouches = 10;

struct Group {
  std::string name;
  double touches = 0, fingers = 0, degrees = 0, sum = 0, squares = 0, excess = 0;
};

class Groups {
 public:
  explicit Groups(double sigma_s) : sigma_s_(sigma_s) {}

  void Add(Group* group, const double* residuals, int fingers, int compared, int only_finger = -1) const {
    ++group->touches;
    // A finger's share of a touch's degrees of freedom: so its RMSE compares with the whole set's.
    const double degrees_a_finger = 1 - 1.0 / compared;
    for (int i = 0; i < fingers; ++i) {
      if (std::isnan(residuals[i]) || (only_finger >= 0 && i != only_finger)) continue;
      group->fingers += 1;
      group->degrees += degrees_a_finger;
      group->sum += residuals[i];
      group->squares += residuals[i] * residuals[i];
      group->excess += residuals[i] * residuals[i] - NoiseShare(sigma_s_, compared);
    }
  }

  void Report(const std::string& kind, const std::vector<Group>& groups, double all_excess,
              v1::Report* report) const {
    if (groups.size() > kMaxGroups) return;
    for (const Group& group : groups) {
      if (group.touches == 0 || group.degrees == 0) continue;
      v1::GroupError* message = report->add_groups();
      message->set_kind(kind);
      message->set_name(group.name);
      message->set_touches(static_cast<uint32_t>(group.touches));
      message->set_rmse_us(std::sqrt(group.squares / group.degrees) * 1e6);
      message->set_mean_residual_us(group.sum / group.fingers * 1e6);
      message->set_share_of_excess_error(all_excess > 0 ? std::clamp(group.excess / all_excess, 0.0, 1.0)
                                                        : 0);
    }
  }

 private:
  const double sigma_s_;
};

// Index of every number among the distinct ones, in their order.
std::vector<Group> Levels(const std::vector<double>& values, std::vector<int>* level,
                          const std::function<std::string(double)>& name) {
  std::vector<double> distinct = values;
  std::sort(distinct.begin(), distinct.end());
  distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
  std::vector<Group> groups(distinct.size());
  for (size_t g = 0; g < distinct.size(); ++g) groups[g].name = name(distinct[g]);
  level->resize(values.size());
  for (size_t k = 0; k < values.size(); ++k)
    (*level)[k] =
        static_cast<int>(std::lower_bound(distinct.begin(), distinct.end(), values[k]) - distinct.begin());
  return groups;
}

}  // namespace

void DescribeGroups(const Observations& observations, const std::vector<double>& residuals, double sigma_s,
                    v1::Report* report) {
  const MeasurementSet& set = *observations.set;
  const int fingers = observations.fingers, size = observations.size();
  const Groups tally(sigma_s);

  // The touches that count, and how many fingers of each.
  std::vector<int> touches, compared;
  for (int k = 0; k < size; ++k) {
    const int count = FingersCompared(observations, residuals, k);
    if (!observations.used[k] || count < 2) continue;
    touches.push_back(k);
    compared.push_back(count);
  }

  // By finger first: their sum is the whole excess.
  std::vector<Group> by_finger(fingers);
  double all_excess = 0;
  for (int i = 0; i < fingers; ++i) {
    by_finger[i].name = FingerName(i, fingers);
    for (size_t n = 0; n < touches.size(); ++n) {
      const double* residual = &residuals[size_t(touches[n]) * fingers];
      if (!std::isnan(residual[i])) tally.Add(&by_finger[i], residual, fingers, compared[n], i);
    }
    all_excess += by_finger[i].excess;
    report->add_finger_bias_us(by_finger[i].fingers ? by_finger[i].sum / by_finger[i].fingers * 1e6 : 0);
  }

  const auto by_level = [&](const std::string& kind, std::vector<Group> groups,
                            const std::vector<int>& level) {
    for (size_t n = 0; n < touches.size(); ++n)
      tally.Add(&groups[level[n]], &residuals[size_t(touches[n]) * fingers], fingers, compared[n]);
    tally.Report(kind, groups, all_excess, report);
  };
  const auto by_number = [&](const std::string& kind, const std::vector<double>& values,
                             const std::function<std::string(double)>& name) {
    std::vector<int> level;
    std::vector<Group> groups = Levels(values, &level, name);
    by_level(kind, std::move(groups), level);
  };
  const auto column = [&](auto value) {
    std::vector<double> values(touches.size());
    for (size_t n = 0; n < touches.size(); ++n) values[n] = value(observations.row[touches[n]]);
    return values;
  };
  const auto whole = [](double value) { return absl::StrCat(static_cast<int>(value)); };

  std::vector<Group> objects(observations.objects.size());
  std::vector<int> object(touches.size());
  for (size_t o = 0; o < objects.size(); ++o) objects[o].name = observations.objects[o];
  for (size_t n = 0; n < touches.size(); ++n) object[n] = observations.object[touches[n]];
  by_level("object", std::move(objects), object);
  if (!set.face.empty()) by_number("face", column([&](int row) { return set.face[row]; }), whole);
  tally.Report("finger", by_finger, all_excess, report);
  if (!set.round.empty()) by_number("round", column([&](int row) { return set.round[row]; }), whole);

  // Time in parts of equal length.
  if (set.has_session_time && !touches.empty()) {
    const std::vector<double> time_s = column([&](int row) { return set.session_time_s[row]; });
    const auto [begin, end] = std::minmax_element(time_s.begin(), time_s.end());
    const double part_s = (*end - *begin) / kTimeBins;
    if (part_s > 0) {
      std::vector<Group> parts(kTimeBins);
      for (int p = 0; p < kTimeBins; ++p)
        parts[p].name = absl::StrCat(std::lround((*begin + p * part_s) / 60), " to ",
                                     std::lround((*begin + (p + 1) * part_s) / 60), " min");
      std::vector<int> part(touches.size());
      for (size_t n = 0; n < touches.size(); ++n)
        part[n] = std::min(kTimeBins - 1, static_cast<int>((time_s[n] - *begin) / part_s));
      by_level("time", std::move(parts), part);
    }
  }
  by_number("speed", column([&](int row) { return std::round(set.speed_m_s[row] * 1e9) * 1e-6; }),
            [](double mm_s) { return absl::StrCat(mm_s, " mm/s"); });

  // The worst touches, largest first.
  std::vector<double> norm2(touches.size(), 0);
  std::vector<int> order(touches.size());
  for (size_t n = 0; n < touches.size(); ++n) {
    order[n] = static_cast<int>(n);
    for (int i = 0; i < fingers; ++i) {
      const double residual_s = residuals[size_t(touches[n]) * fingers + i];
      if (!std::isnan(residual_s)) norm2[n] += residual_s * residual_s;
    }
  }
  const size_t worst = std::min(kWorstTouches, order.size());
  std::partial_sort(order.begin(), order.begin() + worst, order.end(),
                    [&](int a, int b) { return norm2[a] != norm2[b] ? norm2[a] > norm2[b] : a < b; });
  for (size_t n = 0; n < worst; ++n) {
    const int k = touches[order[n]];
    v1::TouchError* message = report->add_worst_touches();
    message->set_touch(set.touch[observations.row[k]]);
    message->set_object(observations.objects[observations.object[k]]);
    message->set_norm_us(std::sqrt(norm2[order[n]]) * 1e6);
    for (int i = 0; i < fingers; ++i) message->add_residual_us(residuals[size_t(k) * fingers + i] * 1e6);
  }
}

}  // namespace touchstone
