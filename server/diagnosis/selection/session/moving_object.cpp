#include "server/diagnosis/selection/session/moving_object.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <Eigen/Core>

#include "server/base/numbers/decompositions.h"
#include "server/base/numbers/distributions.h"
#include "server/base/units.h"
#include "server/diagnosis/selection/session/pose_columns.h"
#include "server/diagnosis/selection/session/repeats.h"
#include "server/diagnosis/selection/session/rules.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr int kTranslations = 3;

// A touch of which every finger has a place.
struct TimedTouch {
  int k = 0, object = 0, pose = 0, round = 0;
  double time = 0;  // since the middle of the object's touches, over their whole length: -0.5 to 0.5
};

struct Rows {
  std::vector<TimedTouch> touches;
  int objects = 0, rounds = 0, fingers = 0;
  bool from_repeats = false;
  double degrees = 0;         // of freedom that the residuals have
  std::vector<double> spans;  // of the objects' touches, s or touches
};

Rows RowsOf(const touches::Observations& o, const touches::Prediction& d,
            const std::vector<double>& residuals) {
  Rows rows;
  rows.fingers = o.fingers;
  const std::vector<int> round = RoundsOfTouches(o);
  std::map<int, std::pair<double, double>> range;
  std::map<int, int> objects, repeats, numbers;
  const auto time_of = [&](int k) {
    return o.set->has_session_time ? o.set->session_time_s[o.row[k]] : static_cast<double>(k);
  };
  for (int k = 0; k < o.size(); ++k) {
    if (!o.used[k] || !HasPoseColumns(o, d, residuals, k)) continue;
    const auto [at, first] = range.try_emplace(o.object[k], time_of(k), time_of(k));
    at->second.first = std::min(at->second.first, time_of(k));
    at->second.second = std::max(at->second.second, time_of(k));
    rows.touches.push_back(
        {k, objects.emplace(o.object[k], static_cast<int>(objects.size())).first->second, o.pose[k],
         numbers.emplace(round[k], static_cast<int>(numbers.size())).first->second, time_of(k)});
    ++repeats[o.pose[k]];
  }
  rows.objects = static_cast<int>(objects.size()), rows.rounds = static_cast<int>(numbers.size());
  double repeated = 0;
  for (const auto& [pose, count] : repeats) repeated += count - 1;
  rows.from_repeats = repeated >= kSessionRules.min_repeated_share * static_cast<double>(rows.touches.size());
  rows.degrees = (o.fingers - 1) * (rows.from_repeats ? repeated : static_cast<double>(rows.touches.size()));
  for (TimedTouch& touch : rows.touches) {
    const auto& [begin, end] = range[o.object[touch.k]];
    touch.time = end > begin ? (touch.time - begin) / (end - begin) - 0.5 : 0;
  }
  return rows;
}

// Less the mean over the repeats of each pose, where repeats tell.
void Centre(const Rows& rows, Eigen::MatrixXd* values) {
  if (!rows.from_repeats) return;
  std::vector<int> pose;
  for (const TimedTouch& touch : rows.touches) pose.push_back(touch.pose);
  CentrePoses(pose, rows.fingers, values);
}

// The share of the variance of time that a plane over places and directions explains, of the worst object.
double OrderShare(const touches::Observations& o, const Rows& rows) {
  double worst = 0;
  for (int object = 0; object < rows.objects; ++object) {
    std::vector<const TimedTouch*> own;
    for (const TimedTouch& touch : rows.touches)
      if (touch.object == object) own.push_back(&touch);
    Eigen::MatrixXd columns(own.size(), 7);
    Eigen::VectorXd time(own.size());
    for (size_t n = 0; n < own.size(); ++n) {
      const int row = o.row[own[n]->k];
      columns.row(static_cast<Eigen::Index>(n)) << 1, o.set->target_m[row].transpose(),
          o.set->approach[row].transpose();
      time[static_cast<Eigen::Index>(n)] = own[n]->time;
    }
    const double all = (time.array() - time.mean()).matrix().squaredNorm();
    if (!(all > 0)) continue;
    const Eigen::MatrixXd basis = ColumnSpan(columns).Basis();
    worst = std::max(worst, 1 - (time - basis * (basis.transpose() * time)).squaredNorm() / all);
  }
  return worst;
}

// What columns take of the residuals beyond a pose of each object and a drift of each finger.
class Comparison {
 public:
  Comparison(const touches::Observations& o, const touches::Prediction& d,
             const std::vector<double>& residuals, const Rows& rows)
      : rows_(rows), pose_(rows.touches.size() * rows.fingers, kPoseValues) {
    const auto n = static_cast<Eigen::Index>(pose_.rows());
    Eigen::MatrixXd values(n, 1);
    Eigen::MatrixXd known = Eigen::MatrixXd::Zero(n, rows.objects * kPoseValues + rows.fingers);
    for (size_t t = 0; t < rows.touches.size(); ++t) {
      const TimedTouch& touch = rows.touches[t];
      const auto first = static_cast<Eigen::Index>(t) * rows.fingers;
      pose_.middleRows(first, rows.fingers) = PoseColumns(o, d, touch.k);
      known.block(first, touch.object * kPoseValues, rows.fingers, kPoseValues) =
          pose_.middleRows(first, rows.fingers);
      for (int i = 0; i < rows.fingers; ++i) {
        values(first + i, 0) = residuals[static_cast<size_t>(touch.k) * rows.fingers + i];
        for (int j = 0; j < rows.fingers; ++j)
          known(first + i, rows.objects * kPoseValues + j) = touch.time * ((i == j) - 1.0 / rows.fingers);
      }
    }
    Centre(rows_, &values), Centre(rows_, &known);
    known_ = ColumnSpan(known).Basis();
    values_ = Beyond(values);
    degrees_ = rows_.degrees - static_cast<double>(known_.cols());
  }

  // `make(touch, own)`: the columns of a touch from those of a pose, fingers x `count`.
  struct Gain {
    double nats = -INFINITY, p = 1;
    Eigen::VectorXd values;
  };
  template <typename Make>
  Gain Of(Eigen::Index count, const Make& make) const {
    Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(pose_.rows(), count);
    for (size_t t = 0; t < rows_.touches.size(); ++t) {
      const auto first = static_cast<Eigen::Index>(t) * rows_.fingers;
      make(rows_.touches[t], pose_.middleRows(first, rows_.fingers),
           columns.middleRows(first, rows_.fingers));
    }
    Centre(rows_, &columns);
    columns = Beyond(columns);
    const ColumnSpan span(columns);
    Gain gain;
    const auto taken = static_cast<double>(span.rank());
    const double all = values_.squaredNorm();
    const double left = all - (span.Basis().transpose() * values_).squaredNorm();
    if (taken == 0 || degrees_ < taken + kSessionRules.min_motion_dof || !(left > 0)) return gain;
    gain.nats = 0.5 * degrees_ * std::log(all / left) - 0.5 * taken * std::log(degrees_);
    gain.p = FisherTail((all - left) / taken / (left / (degrees_ - taken)), taken, degrees_ - taken);
    gain.values = span.Solve(values_);
    return gain;
  }

 private:
  Eigen::MatrixXd Beyond(const Eigen::MatrixXd& columns) const {
    return columns - known_ * (known_.transpose() * columns);
  }

  const Rows& rows_;
  Eigen::MatrixXd pose_, known_;
  Eigen::VectorXd values_;
  double degrees_ = 0;
};

std::string MotionInWords(const MovingObject& found, const Eigen::Vector3d& along, int touches) {
  constexpr char kWhatToDo[] =
      "Whatever holds it gives way: fasten it, register it anew, and touch it again in another order.";
  if (found.turned_rad > 0)
    return absl::StrFormat(
        "The object turns while it is touched, by %.2g deg from its first touch to its "
        "last about (%.2f, %.2f, %.2f). %s",
        found.turned_rad * 180 / M_PI, along.x(), along.y(), along.z(), kWhatToDo);
  return absl::StrFormat(
      "The object moves while it is touched, by %.2g mm from its first touch to its last "
      "(%.2g mm a touch) along (%.2f, %.2f, %.2f). %s",
      found.moved_m * kMillimetresPerMetre, found.moved_m * kMillimetresPerMetre / touches, along.x(),
      along.y(), along.z(), kWhatToDo);
}

}  // namespace

std::optional<MovingObject> FindMovingObject(const touches::Observations& o, const touches::Prediction& d,
                                             const std::vector<double>& residuals) {
  if (o.fingers < 2 || !HasPoseDetails(d, residuals)) return std::nullopt;
  const Rows rows = RowsOf(o, d, residuals);
  if (rows.objects == 0 || rows.objects > kSessionRules.max_moving_objects ||
      rows.degrees < kSessionRules.min_motion_dof)
    return std::nullopt;
  if (!rows.from_repeats && OrderShare(o, rows) > kSessionRules.max_order_share) return std::nullopt;
  const Comparison comparison(o, d, residuals, rows);
  constexpr int kTried = 2;
  const auto steadily = [&](int first) {
    return comparison.Of(kTranslations, [first](const TimedTouch& touch, const auto& own,
                                                Eigen::Ref<Eigen::MatrixXd> columns) {
      columns = touch.time * own.middleCols(first, kTranslations);
    });
  };
  const Comparison::Gain moves = steadily(0), turns = steadily(kTranslations);
  const Comparison::Gain& best = turns.nats > moves.nats ? turns : moves;
  if (best.nats < kSessionRules.min_gain + std::log(kTried)) return std::nullopt;
  if (rows.rounds > 1 && rows.rounds <= kSessionRules.max_moving_rounds) {
    const Comparison::Gain by_round = comparison.Of(
        static_cast<Eigen::Index>(rows.rounds) * rows.objects * kPoseValues,
        [&](const TimedTouch& touch, const auto& own, Eigen::Ref<Eigen::MatrixXd> columns) {
          columns.middleCols((touch.object * rows.rounds + touch.round) * kPoseValues, kPoseValues) = own;
        });
    if (by_round.nats > best.nats) return std::nullopt;
  }
  MovingObject found;
  found.gain_nats = best.nats;
  found.p = std::min(1.0, kTried * best.p);
  const Eigen::Vector3d whole = best.values;
  (&best == &turns ? found.turned_rad : found.moved_m) = whole.norm();
  found.words =
      MotionInWords(found, whole.normalized(), static_cast<int>(rows.touches.size()) / rows.objects);
  return found;
}

void NameMotionFirst(const touches::Observations& o, const MovingObject& moving,
                     engine::UnexplainedRest* rest) {
  engine::PutFirst({touches::NameOfTime(o), moving.p, moving.gain_nats}, rest);
}

}  // namespace touchstone::diagnosis::selection
