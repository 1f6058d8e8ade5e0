#include "server/diagnosis/selection/session/turns.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include <Eigen/Core>

#include "server/base/numbers/decompositions.h"
#include "server/base/numbers/distributions.h"
#include "server/base/text/readable_time.h"
#include "server/diagnosis/selection/session/repeats.h"
#include "server/diagnosis/selection/session/rules.h"
#include "server/model/finger_name.h"

namespace touchstone::diagnosis::selection {
namespace {

// What a place in the turn is compared over: touches less the mean of their pose, where repeats of a pose have several places; else
// the mean of a pose at a place, since a misfit is the same in all repeats. Scaled to the variance of one touch.
struct Units {
  std::vector<int> place;
  Eigen::MatrixXd values;  // units x fingers
  Eigen::MatrixXd known;   // units x what may say the same: place and direction of the pose
  double degrees = 0;      // of freedom, of each finger
};

constexpr int kPoseFeatures = 10;  // 1, target, direction, its squares

Eigen::RowVectorXd FeaturesOf(const session::MeasurementSet& set, int row) {
  Eigen::RowVectorXd features(kPoseFeatures);
  const Eigen::RowVector3d direction = set.approach[row].transpose();
  features << 1, set.target_m[row].transpose(), direction, direction.cwiseProduct(direction);
  return features;
}

struct Reading {
  int k = 0, place = 0;
  Eigen::RowVectorXd residual;
};

using ReadingsByPose = std::map<int, std::vector<Reading>>;

ReadingsByPose ReadingsOf(const touches::Observations& o, const std::vector<double>& residuals,
                          const std::vector<int>& places, int period) {
  ReadingsByPose poses;
  for (int k = 0; k < o.size(); ++k) {
    const Eigen::Map<const Eigen::RowVectorXd> own(&residuals[static_cast<size_t>(k) * o.fingers], o.fingers);
    if (o.used[k] && own.allFinite()) poses[o.pose[k]].push_back({k, places[o.row[k]] % period, own});
  }
  return poses;
}

void AddUnit(int place, const Eigen::RowVectorXd& value, const Eigen::RowVectorXd& known, Units* units) {
  const auto n = static_cast<Eigen::Index>(units->place.size());
  units->place.push_back(place);
  units->values.row(n) = value, units->known.row(n) = known;
}

Units UnitsOf(const touches::Observations& o, const ReadingsByPose& poses) {
  double all = 0, repeated = 0;
  for (const auto& [pose, readings] : poses) {
    all += static_cast<double>(readings.size());
    const bool varies = std::any_of(readings.begin(), readings.end(),
                                    [&](const Reading& r) { return r.place != readings[0].place; });
    if (varies) repeated += static_cast<double>(readings.size()) - 1;
  }
  const bool from_repeats = repeated >= kSessionRules.min_repeated_share * all;
  Units units;
  units.values.resize(static_cast<Eigen::Index>(all), o.fingers);
  units.known = Eigen::MatrixXd::Zero(units.values.rows(), kPoseFeatures);
  for (const auto& [pose, readings] : poses) {
    const Eigen::RowVectorXd features = FeaturesOf(*o.set, o.row[readings[0].k]);
    std::map<int, std::vector<const Reading*>> by_place;
    Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(o.fingers);
    for (const Reading& reading : readings)
      by_place[reading.place].push_back(&reading), sum += reading.residual;
    if (from_repeats) {
      for (const Reading& reading : readings)
        AddUnit(reading.place, reading.residual - sum / static_cast<double>(readings.size()),
                Eigen::RowVectorXd::Zero(kPoseFeatures), &units);
      units.degrees += static_cast<double>(readings.size()) - 1;
      continue;
    }
    for (const auto& [place, own] : by_place) {
      Eigen::RowVectorXd own_sum = Eigen::RowVectorXd::Zero(o.fingers);
      for (const Reading* reading : own) own_sum += reading->residual;
      const double root = std::sqrt(static_cast<double>(own.size()));
      AddUnit(place, own_sum / root, features * root, &units);
      units.degrees += 1;
    }
  }
  const auto count = static_cast<Eigen::Index>(units.place.size());
  units.values.conservativeResize(count, Eigen::NoChange);
  units.known.conservativeResize(count, Eigen::NoChange);
  return units;
}

// Columns of 1 where a unit has a place of a turn of `period`, scaled and centred as its values are.
Eigen::MatrixXd PlaceColumns(const touches::Observations& o, const ReadingsByPose& poses, const Units& like,
                             int period) {
  ReadingsByPose marked = poses;
  Eigen::MatrixXd columns(like.values.rows(), period);
  for (int place = 0; place < period; ++place) {
    for (auto& [pose, readings] : marked)
      for (Reading& reading : readings)
        reading.residual = Eigen::RowVectorXd::Constant(o.fingers, reading.place == place);
    columns.col(place) = UnitsOf(o, marked).values.col(0);
  }
  return columns;
}

class Turn {
 public:
  Turn(const touches::Observations& o, const std::vector<double>& residuals, const std::vector<int>& places,
       int period) {
    const ReadingsByPose poses = ReadingsOf(o, residuals, places, period);
    const Units units = UnitsOf(o, poses);
    for (int place = 0; place < period; ++place)
      if (std::count(units.place.begin(), units.place.end(), place) < kSessionRules.min_units_of_place)
        return;
    const Eigen::MatrixXd known_basis = ColumnSpan(units.known).Basis();
    const auto beyond = [&](const Eigen::MatrixXd& columns) -> Eigen::MatrixXd {
      return columns - known_basis * (known_basis.transpose() * columns);
    };
    const Eigen::MatrixXd values = beyond(units.values);
    const ColumnSpan span(beyond(PlaceColumns(o, poses, units, period)));
    const double fingers = o.fingers - 1.0, taken = fingers * static_cast<double>(span.rank());
    const double degrees = fingers * (units.degrees - static_cast<double>(known_basis.cols()));
    const double all = values.squaredNorm();
    const double left = all - (span.Basis().transpose() * values).squaredNorm();
    if (taken == 0 || !(left > 0) || !(degrees > 2 * taken)) return;
    gain_nats_ = 0.5 * degrees * std::log(all / left) - 0.5 * taken * std::log(degrees);
    p_ = FisherTail((all - left) / taken / (left / (degrees - taken)), taken, degrees - taken);
    ranges_.resize(o.fingers);
    for (int i = 0; i < o.fingers; ++i) {
      const Eigen::VectorXd means = span.Solve(values.col(i));
      ranges_[i] = means.maxCoeff() - means.minCoeff();
    }
  }

  double gain_nats() const { return gain_nats_; }
  double p() const { return p_; }
  const Eigen::VectorXd& ranges() const { return ranges_; }

 private:
  double gain_nats_ = -INFINITY, p_ = 1;
  Eigen::VectorXd ranges_;  // of each finger
};

}  // namespace

std::vector<int> PlacesInSession(const session::MeasurementSet& set) {
  std::vector<int> order(set.size());
  std::iota(order.begin(), order.end(), 0);
  if (set.has_session_time)
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return set.session_time_s[a] < set.session_time_s[b]; });
  std::vector<int> place(order.size());
  for (size_t n = 0; n < order.size(); ++n) place[order[n]] = static_cast<int>(n);
  return place;
}

std::optional<Turns> FindTurns(const touches::Observations& o, const std::vector<double>& residuals) {
  if (o.fingers < 2) return std::nullopt;
  const std::vector<int> places = PlacesInSession(*o.set);
  Turns best;
  best.gain_nats = kSessionRules.min_gain + std::log(kSessionRules.longest_turn - 1.0);
  for (int period = 2; period <= kSessionRules.longest_turn; ++period) {
    const Turn turn(o, residuals, places, period);
    if (turn.gain_nats() <= best.gain_nats) continue;
    best.period = period;
    best.gain_nats = turn.gain_nats();
    best.p = std::min(1.0, turn.p() * (kSessionRules.longest_turn - 1));
    best.range_s = turn.ranges().maxCoeff(&best.finger);
  }
  if (best.period == 0) return std::nullopt;
  best.words = absl::StrFormat(
      "Touches take turns: finger %s is up to %s later at one place in a turn of %d touches than at another. "
      "Look for what is read or switched in turn (a multiplexer, two buffers), and for a tool or an object "
      "that "
      "is laid down alternately.",
      model::FingerName(best.finger, o.fingers), TimeInWords(best.range_s), best.period);
  return best;
}

void NameTurnFirst(const Turns& turns, engine::UnexplainedRest* rest) {
  engine::PutFirst({absl::StrCat("place in turns of ", turns.period, " touches"), turns.p, turns.gain_nats},
                   rest);
}

}  // namespace touchstone::diagnosis::selection
