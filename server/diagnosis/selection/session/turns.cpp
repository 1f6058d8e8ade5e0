#include "server/diagnosis/selection/session/turns.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include <Eigen/Core>

#include "server/base/numbers/distributions.h"
#include "server/base/text/readable_time.h"
#include "server/model/finger_name.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr int kLongestTurn = 8;  // touches
constexpr double kTurnNats = 10;
constexpr int kMinCellsOfPlace = 8;  // readings at each place in the turn

// Place of each row of the set in the order of the session.
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

// Touches of one pose at one place in the turn.
struct Cell {
  Eigen::VectorXd sum;
  double touches = 0;
};

// Turns of `period` touches beyond those of `known`, which divides it; 1: none.
class Turn {
 public:
  Turn(const touches::Observations& o, const std::vector<double>& residuals, const std::vector<int>& places,
       int period, int known)
      : means_(Eigen::MatrixXd::Zero(o.fingers, period)), cells_of_(period, 0) {
    std::map<std::pair<int, int>, Cell> cells;
    for (int k = 0; k < o.size(); ++k) {
      const Eigen::Map<const Eigen::VectorXd> own(&residuals[static_cast<size_t>(k) * o.fingers], o.fingers);
      if (!o.used[k] || !own.allFinite()) continue;
      Cell& cell = cells[{places[o.row[k]] % period, o.pose[k]}];
      if (cell.touches++ == 0) cell.sum = Eigen::VectorXd::Zero(o.fingers);
      cell.sum += own;
    }
    Eigen::MatrixXd known_sums = Eigen::MatrixXd::Zero(o.fingers, known);
    Eigen::VectorXd touches = Eigen::VectorXd::Zero(period), known_touches = Eigen::VectorXd::Zero(known);
    double squares = 0;
    for (const auto& [key, cell] : cells) {
      means_.col(key.first) += cell.sum;
      touches[key.first] += cell.touches;
      ++cells_of_[key.first];
      known_sums.col(key.first % known) += cell.sum;
      known_touches[key.first % known] += cell.touches;
      squares += cell.sum.squaredNorm() / cell.touches;
    }
    if (touches.minCoeff() == 0) return;
    double with = squares, without = squares;
    for (int place = 0; place < known; ++place)
      without -= known_sums.col(place).squaredNorm() / known_touches[place];
    for (int place = 0; place < period; ++place) {
      with -= means_.col(place).squaredNorm() / touches[place];
      means_.col(place) /= touches[place];
    }
    const double taken = (o.fingers - 1.0) * (period - known);
    const double rows = (o.fingers - 1.0) * (static_cast<double>(cells.size()) - known);
    if (!(with > 0) || !(rows > 2 * taken)) return;
    gain_nats_ = 0.5 * rows * std::log(without / with) - 0.5 * taken * std::log(rows);
    p_ = FisherTail((without - with) / taken / (with / (rows - taken)), taken, rows - taken);
  }

  double gain_nats() const { return gain_nats_; }
  double p() const { return p_; }
  bool IsFilled() const { return *std::min_element(cells_of_.begin(), cells_of_.end()) >= kMinCellsOfPlace; }
  Eigen::VectorXd Ranges() const { return means_.rowwise().maxCoeff() - means_.rowwise().minCoeff(); }

 private:
  Eigen::MatrixXd means_;  // fingers x places
  std::vector<int> cells_of_;
  double gain_nats_ = 0, p_ = 1;
};

}  // namespace

std::optional<Turns> FindTurns(const touches::Observations& o, const std::vector<double>& residuals) {
  if (o.fingers < 2) return std::nullopt;
  const std::vector<int> places = PlacesInSession(*o.set);
  Turns best;
  const double enough_nats = kTurnNats + std::log(kLongestTurn - 1.0);
  for (int period = 2; period <= kLongestTurn; ++period) {
    // A multiple of a turn says the same with more values.
    const bool multiple = best.period > 0 && period % best.period == 0;
    const Turn turn(o, residuals, places, period, multiple ? best.period : 1);
    if (!turn.IsFilled() ||
        turn.gain_nats() < (multiple ? enough_nats : std::max(best.gain_nats, enough_nats)))
      continue;
    best.period = period;
    best.gain_nats = turn.gain_nats();
    best.p = std::min(1.0, turn.p() * (kLongestTurn - 1));
    best.range_s = turn.Ranges().maxCoeff(&best.finger);
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
