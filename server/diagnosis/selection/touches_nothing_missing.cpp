#include "server/diagnosis/selection/touches_nothing_missing.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "server/base/status.h"
#include "server/diagnosis/selection/curves/nameless_curve.h"
#include "server/diagnosis/selection/quality.h"
#include "server/diagnosis/selection/rules.h"
#include "server/diagnosis/selection/session/pose_columns.h"
#include "server/diagnosis/selection/session/rules.h"
#include "server/diagnosis/selection/session/turns.h"
#include "server/diagnosis/touches/noise/noise_sample.h"
#include "server/diagnosis/touches/noise/rules.h"
#include "server/diagnosis/touches/noise/ticks.h"

namespace touchstone::diagnosis::selection {
namespace {

// Whether the model says more of the noise than that it is normal and the same for all.
bool HasShapedNoise(const model::Model& model) {
  return std::any_of(model.effects.begin(), model.effects.end(), [](const model::EffectInstance& instance) {
    return instance.effect->random() && instance.effect->role != model::EffectRole::kNoiseLevel &&
           instance.effect->role != model::EffectRole::kDropout;
  });
}

// The given model without dropouts: which fingers report is the data's.
model::Model WithoutDropouts(model::Model model) {
  model.effects.erase(std::remove_if(model.effects.begin(), model.effects.end(),
                                     [](const model::EffectInstance& instance) {
                                       return instance.effect->role == model::EffectRole::kDropout;
                                     }),
                      model.effects.end());
  return model;
}

class Tester {
 public:
  Tester(const Workspace& workspace, const engine::GivenAndEffects& columns)
      : workspace_(workspace),
        given_(columns.given),
        effects_(columns.effects),
        o_(*workspace.searched),
        contrasts_(*workspace.contrasts) {}

  absl::StatusOr<engine::TriedPValues> Run() {
    hypotheses_.AddEffects(*workspace_.rows, effects_);
    TOUCHSTONE_ASSIGN_OR_RETURN(details_,
                                workspace_.searched_predictor->Run(*workspace_.input.model, true, true));
    AddCurves();
    AddTurns();
    AddMovingObject();
    TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::MatrixXd residuals, DataAndDraws());
    // What is left is less than numbers are rounded to: it has no noise, and its pattern is that of rounding.
    const double rms_s =
        std::sqrt(given_.columns.values.col(0).squaredNorm() / std::max(contrasts_.rows(), 1));
    if (rms_s < RoundingS(o_)) return engine::AgreeingPValues(hypotheses_.size());
    // Data of a model without any noise agree to rounding: these do not.
    const auto& given = workspace_.input.model->effects;
    if (std::none_of(given.begin(), given.end(),
                     [](const model::EffectInstance& instance) { return instance.effect->random(); }))
      return engine::ImpossiblePValues(hypotheses_.size());
    const Eigen::MatrixXd linear = hypotheses_.PValues(residuals);
    const Eigen::MatrixXd others = engine::PValuesOfStatistics(Statistics(residuals));
    Eigen::RowVectorXd ticks = Eigen::RowVectorXd::Ones(residuals.cols());
    ticks[0] = TicksP();
    engine::TriedPValues p_values(linear.rows() + others.rows() + 1, residuals.cols());
    p_values << linear, others, ticks;
    return p_values;
  }

 private:
  // Polynomials of one covariate, of each finger by itself: travel that a curve adds.
  void AddCurves() {
    for (const CurveCovariate& covariate : ListCurveCovariates(o_, details_)) {
      const auto [mean, deviation] = MeanAndDeviation(covariate);
      if (!(deviation > 0)) continue;
      AddPerFinger(o_.fingers * (kSelectionRules.curve_degree + 1),
                   [&, mean = mean, deviation = deviation](int k, int i, int column) {
                     const double value = (covariate.value(k, i) - mean) / deviation;
                     if (column / (kSelectionRules.curve_degree + 1) != i || !std::isfinite(value))
                       return 0.0;
                     return std::pow(value, column % (kSelectionRules.curve_degree + 1)) *
                            details_.inverse_speed_s_per_m[static_cast<size_t>(k) * o_.fingers + i];
                   });
    }
  }

  // A mean of each finger at each place in a turn.
  void AddTurns() {
    const std::vector<int> places = PlacesInSession(*o_.set);
    for (int period = 2; period <= kSessionRules.longest_turn; ++period)
      AddPerFinger(o_.fingers * period, [&](int k, int i, int column) {
        return column == i * period + places[o_.row[k]] % period ? 1.0 : 0.0;
      });
  }

  // An object that shifts, or turns, by as much from touch to touch.
  void AddMovingObject() {
    std::vector<Eigen::MatrixXd> poses(o_.size());
    for (int k = 0; k < o_.size(); ++k)
      if (HasPoseColumns(o_, details_, o_.time_s, k)) poses[k] = PoseColumns(o_, details_, k);
    for (const int first : {0, kPoseValues / 2})
      AddPerFinger(kPoseValues / 2, [&](int k, int i, int column) {
        return poses[k].size() > 0 ? poses[k](i, first + column) * k : 0;
      });
  }

  // `value(k, finger, column)`: what a column adds to a time, in any unit.
  template <typename Value>
  void AddPerFinger(int count, const Value& value) {
    Eigen::MatrixXd columns(contrasts_.rows(), count);
    std::vector<double> per_finger(o_.time_s.size());
    for (int column = 0; column < count; ++column) {
      for (int k = 0; k < o_.size(); ++k)
        for (int i = 0; i < o_.fingers; ++i)
          per_finger[static_cast<size_t>(k) * o_.fingers + i] = value(k, i, column);
      columns.col(column) = contrasts_.Apply(per_finger);
    }
    hypotheses_.Add(columns);
  }

  std::pair<double, double> MeanAndDeviation(const CurveCovariate& covariate) const {
    double count = 0, sum = 0, squares = 0;
    for (const int k : contrasts_.touches())
      for (int i = 0; i < o_.fingers; ++i)
        if (const double value = covariate.value(k, i); std::isfinite(value))
          count += 1, sum += value, squares += value * value;
    if (count == 0) return {0, 0};
    return {sum / count, std::sqrt(std::max(squares / count - sum * sum / count / count, 0.0))};
  }

  // The residual of the data, then of draws from the given model; columns.
  absl::StatusOr<Eigen::MatrixXd> DataAndDraws() const {
    const Eigen::VectorXd data = given_.columns.values.col(0);
    if (!HasShapedNoise(*workspace_.input.model))
      return engine::DataAndNoise(*workspace_.rows, data, workspace_.input.seed);
    Eigen::MatrixXd residuals(contrasts_.rows(), 1 + kSelectionRules.simulated_draws);
    residuals.col(0) = data;
    const model::Model drawn_from = WithoutDropouts(*workspace_.input.model);
    for (int draw = 1; draw <= kSelectionRules.simulated_draws; ++draw) {
      TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<double> noise_s,
                                  workspace_.searched_predictor->Draw(drawn_from, draw));
      for (size_t e = 0; e < noise_s.size(); ++e) {
        noise_s[e] -= workspace_.searched_nominal.time_s[e];
        if (!std::isfinite(noise_s[e])) noise_s[e] = 0;
      }
      residuals.col(draw) = contrasts_.Apply(noise_s);
    }
    return residuals;
  }

  // Of times that lie on a tick, all, a part or one finger's, where the given model has none: each would with 2 tolerance / tick.
  double TicksP() const {
    const auto& given = workspace_.input.model->effects;
    const bool declared = std::any_of(given.begin(), given.end(), [](const model::EffectInstance& instance) {
      return instance.effect->role == model::EffectRole::kQuantisation;
    });
    if (declared) return 1;
    const touches::TouchTicks ticks = touches::FindTouchTicks(o_);
    const touches::FingerTicks own = touches::FindFingerTicks(o_);
    const auto by_chance = [](double interval_s, int times) {
      return interval_s > 0 ? std::pow(2 * touches::kNoiseRules.tick_tolerance / interval_s, times) : 1;
    };
    return std::min(by_chance(ticks.interval_s, ticks.touches), by_chance(own.interval_s, own.times));
  }

  // What the noise looks like and what repeats share, of each draw (columns), whatever its size.
  Eigen::MatrixXd Statistics(const Eigen::MatrixXd& residuals) const {
    const std::vector<double> tangents = touches::TangentsOfIncidence(details_);
    const int count = static_cast<int>(contrasts_.touches().size());
    Eigen::MatrixXd statistics = Eigen::MatrixXd::Zero(o_.fingers + 5, residuals.cols());
    std::vector<double> steepness(count), moment(count);
    for (int t = 0; t < count; ++t) {
      const int k = contrasts_.touches()[t];
      moment[t] = k;
      for (int i = 0; i < o_.fingers; ++i)
        if (contrasts_.TakesPart(t, i))
          steepness[t] = std::max(steepness[t], tangents[static_cast<size_t>(k) * o_.fingers + i]);
    }
    Centre(&steepness), Centre(&moment);
    for (int draw = 0; draw < residuals.cols(); ++draw) {
      const Eigen::VectorXd r = residuals.col(draw) / std::max(residuals.col(draw).norm(), 1e-300);
      auto statistic = statistics.col(draw);
      std::vector<Eigen::VectorXd> mean(o_.poses);
      std::vector<int> repeats(o_.poses, 0);
      for (int t = 0; t < count; ++t) {
        const int first = contrasts_.FirstRow(t), rows = contrasts_.FirstRow(t + 1) - first;
        const Eigen::VectorXd own = r.segment(first, rows);
        const double square = own.squaredNorm();
        const Eigen::VectorXd fingers = contrasts_.MatrixOf(t).transpose() * own;
        for (int i = 0; i < o_.fingers; ++i) statistic[i] += fingers[i] * fingers[i];
        statistic[o_.fingers] += square * steepness[t];
        statistic[o_.fingers + 1] += square * moment[t];
        statistic[o_.fingers + 2] += square * square;
        if (rows != o_.fingers - 1) continue;
        if (t > 0 && contrasts_.FirstRow(t) - contrasts_.FirstRow(t - 1) == rows)
          statistic[o_.fingers + 3] += own.dot(r.segment(contrasts_.FirstRow(t - 1), rows));
        const int pose = o_.pose[contrasts_.touches()[t]];
        if (repeats[pose]++ == 0) mean[pose] = Eigen::VectorXd::Zero(rows);
        mean[pose] += own;
      }
      for (int i = 0; i < o_.fingers; ++i) statistic[i] = std::log(std::max(statistic[i], 1e-300));
      statistic[o_.fingers + 2] = std::log(std::max(statistic[o_.fingers + 2], 1e-300));
      for (int pose = 0; pose < o_.poses; ++pose)
        if (repeats[pose] > 1) statistic[o_.fingers + 4] += mean[pose].squaredNorm() / repeats[pose];
    }
    return statistics;
  }

  static void Centre(std::vector<double>* values) {
    const double mean =
        std::accumulate(values->begin(), values->end(), 0.0) / static_cast<double>(values->size());
    for (double& value : *values) value -= mean;
  }

  const Workspace& workspace_;
  const engine::Fit& given_;
  const std::vector<engine::EffectColumns>& effects_;
  const touches::Observations& o_;
  const touches::Contrasts& contrasts_;
  touches::Prediction details_;
  engine::LinearHypotheses hypotheses_;
};

}  // namespace

absl::StatusOr<engine::TriedPValues> TryOnTouches(const Workspace& workspace,
                                                  const engine::GivenAndEffects& columns) {
  return Tester(workspace, columns).Run();
}

}  // namespace touchstone::diagnosis::selection
