#include "server/diagnosis/engine/fit/held_out.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "server/base/numbers/decompositions.h"
#include "server/base/status.h"
#include "server/diagnosis/engine/fit/rules.h"

namespace touchstone::diagnosis::engine {
namespace {

using Folds = std::vector<std::vector<int>>;  // the rows of each part that is left out

bool HasOwnValues(const Parameterization& model) {
  return std::any_of(model.parameters().begin(), model.parameters().end(),
                     [](const FreeParameter& c) { return !c.object.empty(); });
}

// Empty: a group's own values cannot be learned from other groups, and two groups say too little of a third.
Folds GroupFolds(const ObservationModel& observations, const Parameterization& model) {
  if (observations.groups().size() < 3 || HasOwnValues(model)) return {};
  Folds folds(observations.groups().size());
  for (int row = 0; row < observations.rows(); ++row) folds[observations.GroupOfRow(row)].push_back(row);
  return folds;
}

Folds BlockFolds(const ObservationModel& observations) {
  Folds folds(kFitRules.folds.value());
  for (int row = 0; row < observations.rows(); ++row)
    folds[observations.BlockOfRow(row) % kFitRules.folds].push_back(row);
  return folds;
}

// Stretches of time with as many rows each; of each group's own time where groups have values of their own, since the
// rest of the session may say nothing of them. What was measured at one time (a touch, a photograph) is not parted: the
// half that was seen would tell of the other. Empty where all has one time.
Folds TimeFolds(const ObservationModel& observations, bool own_values) {
  Folds folds(kFitRules.folds.value());
  const auto divide = [&](int begin, int end) {
    std::vector<int> order(end - begin);
    std::iota(order.begin(), order.end(), begin);
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return observations.TimeOfRow(a) < observations.TimeOfRow(b); });
    size_t first = 0;  // of the rows of this time
    for (size_t place = 0; place < order.size(); ++place) {
      if (observations.TimeOfRow(order[place]) != observations.TimeOfRow(order[first])) first = place;
      folds[first * kFitRules.folds / order.size()].push_back(order[place]);
    }
  };
  const int groups = static_cast<int>(observations.groups().size());
  if (!own_values) divide(0, observations.rows());
  for (int group = 0; own_values && group < groups; ++group)
    divide(observations.FirstRowOfGroup(group), observations.FirstRowOfGroup(group + 1));
  if (static_cast<int>(folds[0].size()) == observations.rows()) return {};
  return folds;
}

// The rows without one part: what is left out is neither wrong nor moved by anything.
class WithoutRows : public ObservationModel {
 public:
  WithoutRows(const ObservationModel& all, const std::vector<int>& left_out)
      : all_(all), left_out_(left_out) {}

  int rows() const override { return all_.rows(); }
  const std::vector<std::string>& groups() const override { return all_.groups(); }
  int FirstRowOfGroup(int group) const override { return all_.FirstRowOfGroup(group); }
  int GroupOfRow(int row) const override { return all_.GroupOfRow(row); }
  int BlockOfRow(int row) const override { return all_.BlockOfRow(row); }
  double TimeOfRow(int row) const override { return all_.TimeOfRow(row); }
  absl::StatusOr<std::vector<double>> Predict(const model::Model& model) const override {
    return all_.PredictOthers(model, left_out_);
  }
  absl::StatusOr<std::vector<double>> PredictNear(const model::Model& moved, const model::Model& at,
                                                  const std::vector<double>& predicted) const override {
    return all_.PredictOthersNear(moved, at, predicted, left_out_);
  }
  double DerivativeStep() const override { return all_.DerivativeStep(); }
  bool HasRoughDerivatives(const model::Effect& effect) const override {
    return all_.HasRoughDerivatives(effect);
  }
  Eigen::VectorXd Residual(const std::vector<double>& predicted) const override {
    return Without(all_.Residual(predicted));
  }
  Eigen::VectorXd Change(const std::vector<double>& predicted,
                         const std::vector<double>& moved) const override {
    return Without(all_.Change(predicted, moved));
  }

 private:
  Eigen::VectorXd Without(Eigen::VectorXd rows) const {
    for (const int row : left_out_) rows[row] = 0;
    return rows;
  }
  const ObservationModel& all_;
  const std::vector<int>& left_out_;
};

// The fit, where a search without these rows begins. A value of which the other rows know next to nothing begins where
// it changes nothing: it must not stay what the rows that are left out have said.
Parameterization StartWithout(const Fit& fit, const std::vector<int>& left_out) {
  Eigen::VectorXd point = fit.point;
  for (int i = 0; i < fit.model.size(); ++i) {
    const auto column = fit.columns.values.col(1 + i);
    double inside = 0;
    for (const int row : left_out) inside += column[row] * column[row];
    if (column.squaredNorm() - inside < kFitRules.uninformed * column.squaredNorm())
      point[i] = fit.model.parameters()[i].neutral;
  }
  Parameterization start = fit.model;
  start.MoveTo(start.Clip(point));
  return start;
}

// The fit without each of the parts in turn.
absl::StatusOr<std::vector<RefitWithoutPart>> Refit(const Experiment& experiment, const Fit& fit,
                                                    const Folds& folds) {
  std::vector<RefitWithoutPart> refits;
  for (const std::vector<int>& fold : folds) {
    if (fold.empty()) continue;
    const WithoutRows others(*experiment.observations, fold);
    Experiment without = experiment;
    without.observations = &others;
    TOUCHSTONE_ASSIGN_OR_RETURN(Fit again,
                                FitModel(without, StartWithout(fit, fold), kFitRules.refit_iterations));
    refits.push_back({fold, std::move(again)});
  }
  return refits;
}

// The least squares step within the parameters' bounds: what runs out of them is held there.
Eigen::VectorXd BoundedStep(const Eigen::MatrixXd& inner, const Eigen::VectorXd& target, const Fit& fit) {
  const int p = fit.model.size();
  Eigen::VectorXd step = Eigen::VectorXd::Zero(p);
  std::vector<int> free(p);
  for (int i = 0; i < p; ++i) free[i] = i;
  while (!free.empty()) {
    const int n = static_cast<int>(free.size());
    Eigen::MatrixXd a(n, n);
    Eigen::VectorXd b(n);
    const Eigen::VectorXd left = target - inner * step;  // what is held at a bound has moved already
    for (int i = 0; i < n; ++i) {
      b[i] = left[free[i]];
      for (int j = 0; j < n; ++j) a(i, j) = inner(free[i], free[j]);
    }
    const Eigen::VectorXd x = SymmetricSolver(a).Solve(b);
    int out = -1;
    for (int i = 0; i < n && out < 0; ++i) {
      const FreeParameter& c = fit.model.parameters()[free[i]];
      const double to = fit.point[free[i]] + x[i], slack = 1e-12 * (std::abs(c.upper) + std::abs(c.lower));
      if (to >= c.lower - slack && to <= c.upper + slack) continue;
      out = i;
      step[free[i]] = (to < c.lower ? c.lower : c.upper) - fit.point[free[i]];
    }
    if (out >= 0) {
      free.erase(free.begin() + out);
      continue;
    }
    for (int i = 0; i < n; ++i) step[free[i]] = x[i];
    break;
  }
  return step;
}

// One linear step from the whole fit for each part that is left out: its sums of squares.
std::vector<double> LinearHeldOut(const Experiment& experiment, const Folds& folds, const Fit& fit) {
  const Eigen::MatrixXd& columns = fit.columns.values;
  const int n = static_cast<int>(columns.rows()), p = fit.model.size();
  if (n == 0) return {};
  const Eigen::VectorXd r = columns.col(0);
  const Eigen::MatrixXd j = columns.rightCols(p);
  Eigen::MatrixXd all = j.transpose() * j;
  const Eigen::VectorXd target = j.transpose() * r;
  const double variance = r.squaredNorm() / n;
  for (int i = 0; i < p; ++i) {
    const double scale = fit.model.parameters()[i].scale;
    all(i, i) += variance / (scale * scale);  // what the other rows leave open stays where it is
  }
  std::vector<double> squares;
  for (const std::vector<int>& fold : folds) {
    if (fold.empty()) continue;
    Eigen::MatrixXd jf(fold.size(), p);
    Eigen::VectorXd rf(fold.size());
    for (size_t k = 0; k < fold.size(); ++k) jf.row(k) = j.row(fold[k]), rf[k] = r[fold[k]];
    const Eigen::VectorXd step = BoundedStep(all - jf.transpose() * jf, target - jf.transpose() * rf, fit);
    const std::optional<double> own =
        experiment.observations->SquaresOfUnseen(fit.model.At(fit.point + step), fold);
    squares.push_back(own.has_value() ? *own : (rf - jf * step).squaredNorm());
  }
  return squares;
}

// The sum of squares of the rows that a fit did not see.
absl::StatusOr<double> UnseenSquares(const ObservationModel& observations, const RefitWithoutPart& refit) {
  const std::optional<double> own = observations.SquaresOfUnseen(refit.fit.model.base(), refit.rows);
  if (own.has_value()) return *own;
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> predicted,
                              observations.CompletePrediction(refit.fit.model.base(), refit.fit.predicted));
  const Eigen::VectorXd residual = observations.Residual(predicted);
  double sum = 0;
  for (const int row : refit.rows) sum += residual[row] * residual[row];
  return sum;
}

// By group; by block where that cannot be.
Folds GroupOrBlockFolds(const ObservationModel& observations, const Parameterization& model) {
  Folds folds = GroupFolds(observations, model);
  return folds.empty() ? BlockFolds(observations) : folds;
}

double RootMean(const std::vector<double>& squares, const Fit& fit) {
  const double n = static_cast<double>(fit.columns.values.rows());
  return n > 0 ? std::sqrt(std::accumulate(squares.begin(), squares.end(), 0.0) / n) : 0;
}

}  // namespace

std::vector<double> HeldOutSquares(const Experiment& experiment, const Fit& fit) {
  return LinearHeldOut(experiment, GroupOrBlockFolds(*experiment.observations, fit.model), fit);
}

absl::StatusOr<std::vector<double>> HeldOutSquaresRefitted(const Experiment& experiment, const Fit& fit) {
  if (fit.model.size() == 0) return HeldOutSquares(experiment, fit);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<RefitWithoutPart> refits,
                              Refit(experiment, fit, GroupOrBlockFolds(*experiment.observations, fit.model)));
  std::vector<double> squares;
  for (const RefitWithoutPart& refit : refits) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const double unseen, UnseenSquares(*experiment.observations, refit));
    squares.push_back(unseen);
  }
  return squares;
}

double HeldOutRmse(const Experiment& experiment, const Fit& fit) {
  return RootMean(HeldOutSquares(experiment, fit), fit);
}

double HeldOutRmseByBlock(const Experiment& experiment, const Fit& fit) {
  return RootMean(LinearHeldOut(experiment, BlockFolds(*experiment.observations), fit), fit);
}

HeldOutFall FallOfHeldOut(const std::vector<double>& before, const std::vector<double>& after,
                          double negligible) {
  const double count = static_cast<double>(before.size());
  double sum = 0, squares = 0;
  for (size_t part = 0; part < before.size(); ++part) {
    const double fall = std::log((before[part] + negligible) / (after[part] + negligible));
    sum += fall, squares += fall * fall;
  }
  const double mean = sum / count;
  return {mean, std::sqrt(std::max(0.0, squares / count - mean * mean) / (count - 1))};
}

absl::StatusOr<std::vector<std::vector<RefitWithoutPart>>> RefitWithoutParts(const Experiment& experiment,
                                                                             const Fit& fit) {
  const ObservationModel& observations = *experiment.observations;
  const Likelihood plain(observations.GroupRows(), nullptr, 0, nullptr);
  Experiment without_surface = experiment;
  without_surface.likelihood = &plain;
  std::vector<std::vector<RefitWithoutPart>> divisions;
  for (const Folds& folds : {GroupFolds(observations, fit.model), BlockFolds(observations),
                             TimeFolds(observations, HasOwnValues(fit.model))}) {
    TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<RefitWithoutPart> refits, Refit(without_surface, fit, folds));
    if (!refits.empty()) divisions.push_back(std::move(refits));
  }
  return divisions;
}

absl::StatusOr<double> HeldOutRmseRefitted(const Experiment& experiment, const Fit& fit) {
  const ObservationModel& observations = *experiment.observations;
  const int n = observations.rows();
  if (n == 0 || fit.model.size() == 0) return HeldOutRmse(experiment, fit);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<std::vector<RefitWithoutPart>> divisions,
                              RefitWithoutParts(experiment, fit));
  double largest = 0;
  for (const std::vector<RefitWithoutPart>& refits : divisions) {
    double sum = 0;
    for (const RefitWithoutPart& refit : refits) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const double unseen, UnseenSquares(observations, refit));
      sum += unseen;
    }
    largest = std::max(largest, sum);
  }
  return std::sqrt(largest / n);
}

}  // namespace touchstone::diagnosis::engine
