#include "server/diagnosis/selection/curves/nameless_curve.h"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/base/numbers/decompositions.h"
#include "server/base/units.h"
#include "server/diagnosis/engine/fit/laplace_evidence.h"
#include "server/diagnosis/selection/curves/held_out_curve.h"
#include "server/diagnosis/selection/curves/rules.h"
#include "server/diagnosis/selection/curves/time_course.h"

namespace touchstone::diagnosis::selection {
namespace {

// Knots half by rank and half by value: dense where data are, and nowhere far apart.
std::vector<double> PlaceKnots(std::vector<double> values, int count) {
  std::sort(values.begin(), values.end());
  std::vector<double> knots;
  const double min = values.front(), range = values.back() - min;
  std::vector<double> distinct = values;
  distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
  if (static_cast<int>(distinct.size()) <= count / 2) return distinct;
  for (int j = 0; j < count; ++j) {
    const double share = j / (count - 1.0);
    const double by_rank = values[static_cast<size_t>(share * (values.size() - 1))];
    const double knot = 0.5 * (by_rank + min + share * range);
    if (knots.empty() || knot > knots.back() + 1e-9 * range) knots.push_back(knot);
  }
  return knots;
}

// The penalty of one finger's curve, for a bend of 1 over a size of 1: D'D, second differences.
Eigen::MatrixXd BendPenalty(int knots) {
  Eigen::MatrixXd penalty = Eigen::MatrixXd::Zero(knots, knots);
  for (int j = 1; j + 1 < knots; ++j) {
    Eigen::VectorXd row = Eigen::VectorXd::Zero(knots);
    row[j - 1] = row[j + 1] = 1;
    row[j] = -2;
    penalty += row * row.transpose();
  }
  return penalty;
}

double LogDeterminant(const Eigen::LLT<Eigen::MatrixXd>& factor) {
  return 2 * Eigen::MatrixXd(factor.matrixL()).diagonal().array().log().sum();
}

class CurveScorer {
 public:
  CurveScorer(const engine::Experiment& experiment, const touches::TouchObservationModel& touches,
              const engine::Fit& fit, const touches::Prediction& details)
      : experiment_(experiment),
        likelihood_(*experiment.likelihood),
        touches_(touches),
        o_(touches.observations()),
        fit_(fit),
        details_(details) {
    std::vector<double> base;
    for (int s = 0; s < static_cast<int>(likelihood_.hypotheses().size()); ++s)
      base.push_back(Evidence(likelihood_.Gram(fit_.columns, s), s, Eigen::MatrixXd()).log_evidence);
    const auto best = std::max_element(base.begin(), base.end());
    double sum = 0;
    for (int s = 0; s < static_cast<int>(base.size()); ++s) {
      sum += std::exp(base[s] - *best);
      if (s == 0 || base[s] > *best - kCurveRules.negligible_surface) hypotheses_.push_back(s);
    }
    base_log_ = *best + std::log(sum);
    few_hypotheses_ = {0};
    if (best != base.begin()) few_hypotheses_.push_back(static_cast<int>(best - base.begin()));
  }

  // Time in s of the rows for a value of 1 (mm or us) at each knot.
  bool MakeBasis(const CurveCovariate& covariate, NamelessCurve* curve) {
    std::vector<double> values;
    for (const int k : touches_.contrasts().touches())
      for (int i = 0; i < o_.fingers; ++i)
        if (const double value = covariate.value(k, i); std::isfinite(value)) values.push_back(value);
    if (values.empty()) return false;
    curve->knots = PlaceKnots(std::move(values), covariate.of_time || !curve->per_finger
                                                     ? kCurveRules.knots.value()
                                                     : kCurveRules.knots_per_finger.value());
    const int knots = static_cast<int>(curve->knots.size()), lists = curve->per_finger ? o_.fingers : 1;
    if (knots < 2 || 3 * knots * lists > touches_.rows()) return false;
    basis_.resize(touches_.rows(), knots * lists);
    std::vector<double> per_finger(o_.time_s.size());
    for (int list = 0; list < lists; ++list)
      for (int j = 0; j < knots; ++j) {
        for (int k = 0; k < o_.size(); ++k)
          for (int i = 0; i < o_.fingers; ++i) {
            const size_t e = static_cast<size_t>(k) * o_.fingers + i;
            per_finger[e] = curve->per_finger && i != list
                                ? 0
                                : Hat(curve->knots, j, covariate.value(k, i)) * Slope(e, curve->adds_time);
          }
        basis_.col(list * knots + j) = touches_.contrasts().Apply(per_finger);
      }
    return true;
  }

  // Fills the gain and the values. The surface's most probable size first: a curve that gains nothing there gains
  // nothing.
  void Fit(NamelessCurve* curve) {
    FitUnder(few_hypotheses_, curve);
    if (curve->gain_nats > kCurveRules.worth_all) FitUnder(hypotheses_, curve);
  }

  // The errors on what is left out, without a surface: what holds elsewhere must not need one.
  void HoldOut(NamelessCurve* curve) const {
    curve->heldout_without_s =
        HeldOutBeside(experiment_, touches_, fit_, Eigen::MatrixXd(), Eigen::MatrixXd(), curve->of_time);
    curve->heldout_with_s = HeldOutBeside(experiment_, touches_, fit_, basis_, precision_, curve->of_time);
  }

 private:
  struct Part {
    double log_evidence = -INFINITY;
    double effective_dof = 0;
    Eigen::VectorXd values;
  };

  void FitUnder(const std::vector<int>& hypotheses, NamelessCurve* curve) {
    const int knots = static_cast<int>(curve->knots.size()), lists = curve->per_finger ? o_.fingers : 1;
    const double size = TypicalSize(curve->adds_time);
    const engine::Likelihood::Columns all =
        engine::Likelihood::Join(fit_.columns, likelihood_.Prepare(basis_));
    double best = -INFINITY, sum = 0;
    std::vector<double> evidences;
    for (const int s : hypotheses) {
      const Eigen::MatrixXd gram = likelihood_.Gram(all, s);
      for (int bend = 0; bend < (knots > 2 ? kCurveRules.bends.value() : 1); ++bend) {
        const Eigen::MatrixXd precision = Precision(knots, lists, size, bend);
        const Part part = Evidence(gram, s, precision);
        const double evidence = part.log_evidence - std::log(knots > 2 ? kCurveRules.bends.value() : 1.0);
        evidences.push_back(evidence);
        if (evidence <= best) continue;
        best = evidence;
        precision_ = precision;
        curve->effective_dof = part.effective_dof;
        curve->values.assign(lists, std::vector<double>(knots));
        for (int list = 0; list < lists; ++list)
          for (int j = 0; j < knots; ++j) curve->values[list][j] = part.values[list * knots + j];
      }
    }
    for (const double evidence : evidences) sum += std::exp(evidence - best);
    curve->gain_nats = best + std::log(sum) - base_log_;
  }

  static double Hat(const std::vector<double>& knots, int j, double x) {
    if (!std::isfinite(x)) return 0;
    const int last = static_cast<int>(knots.size()) - 1;
    if (x <= knots.front()) return j == 0;
    if (x >= knots.back()) return j == last;
    if (j > 0 && x >= knots[j - 1] && x <= knots[j]) return (x - knots[j - 1]) / (knots[j] - knots[j - 1]);
    if (j < last && x >= knots[j] && x <= knots[j + 1]) return (knots[j + 1] - x) / (knots[j + 1] - knots[j]);
    return 0;
  }

  double Slope(size_t entry, bool adds_time) const {
    if (adds_time) return kSecondsPerMicrosecond;
    const double slope = kMetresPerMillimetre * details_.inverse_speed_s_per_m[entry];
    return std::isfinite(slope) ? slope : 0;
  }

  double TypicalSize(bool adds_time) const {
    const double speed_m_s = o_.set->speed_m_s[o_.row[0]];
    return adds_time ? kCurveRules.typical_curve.value() / speed_m_s * kMicrosecondsPerSecond
                     : kCurveRules.typical_curve.value() * kMillimetresPerMetre;
  }

  // Of the values, over the variance of the noise.
  Eigen::MatrixXd Precision(int knots, int lists, double size, int bend) const {
    const double bend_size = size * std::pow(1.0 / 3, bend), variance = fit_.sigma * fit_.sigma;
    Eigen::MatrixXd one = BendPenalty(knots) / (bend_size * bend_size);
    one.diagonal().array() += 1 / (size * size * knots);  // a shift of the whole curve by `size` costs 1/2
    Eigen::MatrixXd all = Eigen::MatrixXd::Zero(knots * lists, knots * lists);
    for (int list = 0; list < lists; ++list) all.block(list * knots, list * knots, knots, knots) = one;
    return all * variance;
  }

  // gram: of [residual | the fit's columns | the curve's].
  Part Evidence(const Eigen::MatrixXd& gram, int s, const Eigen::MatrixXd& precision) const {
    const int p = fit_.model.size(), m = static_cast<int>(precision.cols());
    double q = gram(0, 0);
    Eigen::MatrixXd a = gram.bottomRightCorner(m, m);
    Eigen::VectorXd b = gram.col(0).tail(m);
    if (p > 0) {
      Eigen::MatrixXd jj = gram.block(1, 1, p, p);
      for (int i = 0; i < p; ++i) jj(i, i) *= 1 + 1e-9, jj(i, i) += 1e-300;
      const SymmetricSolver solver(jj);
      const Eigen::VectorXd own = solver.SolveColumns(gram.block(1, 0, p, 1));
      q -= gram.block(1, 0, p, 1).col(0).dot(own);
      if (m > 0) {
        const Eigen::MatrixXd cross = gram.block(1, 1 + p, p, m);
        a -= cross.transpose() * solver.SolveColumns(cross);
        b -= cross.transpose() * own;
      }
    }
    Part part;
    double occam = 0;
    if (m > 0) {
      const Eigen::LLT<Eigen::MatrixXd> prior(precision), posterior(a + precision);
      if (prior.info() != Eigen::Success || posterior.info() != Eigen::Success) return part;
      part.values = posterior.solve(b);
      part.effective_dof = posterior.solve(a).trace();
      q -= b.dot(part.values);
      occam = 0.5 * (LogDeterminant(posterior) - LogDeterminant(prior));
    }
    part.log_evidence = likelihood_.LogPrior(s) + likelihood_.LogLikelihood(q, s) - occam;
    return part;
  }

  const engine::Experiment& experiment_;
  const engine::Likelihood& likelihood_;
  const touches::TouchObservationModel& touches_;
  const touches::Observations& o_;
  const engine::Fit& fit_;
  const touches::Prediction& details_;
  std::vector<int> hypotheses_, few_hypotheses_;  // of the surface
  double base_log_ = 0;
  Eigen::MatrixXd basis_, precision_;  // of the curve at hand
};

}  // namespace

std::vector<NamelessCurve> ScoreCurves(const engine::Experiment& experiment,
                                       const touches::TouchObservationModel& touches, const engine::Fit& fit,
                                       const touches::Prediction& details, const std::string& only) {
  const touches::Observations& o = touches.observations();
  CurveScorer scorer(experiment, touches, fit, details);
  const std::vector<double>& speeds = o.set->speed_m_s;
  const bool several_speeds = !speeds.empty() && *std::max_element(speeds.begin(), speeds.end()) >
                                                     *std::min_element(speeds.begin(), speeds.end());
  std::vector<CurveCovariate> covariates = ListCurveCovariates(o, details);
  std::vector<NamelessCurve> curves;
  int tried = 0;
  for (const CurveCovariate& covariate : covariates) {
    NamelessCurve best;
    std::vector<double> competing;
    for (const bool per_finger : {false, true})
      for (const bool adds_time : {false, true}) {
        if ((!per_finger && !covariate.differs) || (adds_time && !several_speeds)) continue;
        ++tried;
        if (!only.empty() && covariate.name != only) continue;
        NamelessCurve curve;
        curve.covariate = covariate.name;
        curve.of_time = covariate.of_time;
        curve.per_finger = per_finger;
        curve.adds_time = adds_time;
        if (!scorer.MakeBasis(covariate, &curve)) continue;
        scorer.Fit(&curve);
        if (only.empty() ? curve.gain_nats > kCurveRules.min_gain / 2 : true) scorer.HoldOut(&curve);
        competing.push_back(curve.gain_nats);
        if (best.covariate.empty() || curve.gain_nats > best.gain_nats) best = std::move(curve);
      }
    TimeCourses courses;
    if (covariate.of_time && (only.empty() || covariate.name == only))
      courses = ScoreTimeCourses(experiment, touches, fit, details, covariate);
    for (NamelessCurve& course : courses.curves) {
      ++tried;
      competing.push_back(course.gain_nats);
      if (best.covariate.empty() || course.gain_nats > best.gain_nats) best = std::move(course);
    }
    best.one_finger_constant_nats = courses.one_finger_constant_nats;
    best.one_finger_line_nats = courses.one_finger_line_nats;
    best.any_gain_nats = engine::LogSum(competing) - std::log(std::max<double>(1, competing.size()));
    if (!best.covariate.empty()) curves.push_back(std::move(best));
  }
  // An evidence ratio of x is reached by chance with a probability below 1 / x (Markov); every curve is paid for.
  for (NamelessCurve& curve : curves)
    curve.p = std::min(1.0, tried * std::exp(-std::max(curve.gain_nats, 0.0)));
  std::stable_sort(curves.begin(), curves.end(),
                   [](const NamelessCurve& a, const NamelessCurve& b) { return a.gain_nats > b.gain_nats; });
  return curves;
}

bool IsSignificant(const NamelessCurve& curve) {
  return curve.gain_nats > kCurveRules.min_gain && curve.heldout_with_s > 0 &&
         curve.heldout_with_s < (1 - kCurveRules.min_held_out_gain) * curve.heldout_without_s;
}

}  // namespace touchstone::diagnosis::selection
