#include "server/diagnosis/selection/formula_terms.h"

#include <Eigen/Cholesky>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>

#include <algorithm>
#include <cmath>

#include "server/base/text.h"
#include "server/diagnosis/selection/term_factors.h"
#include "server/effects/formula.h"

namespace touchstone {
namespace {

// The size of a term that rigs show: scale of the prior.
constexpr double kTypicalTravelM = 0.2e-3;
constexpr int kPeriods = 40;
constexpr double kMinPeriodMm = 1.5, kMaxPeriodMm = 40;

ParameterInfo Bounded(const std::string& name, Unit unit, double most) {
  ParameterInfo parameter;
  parameter.name = name;
  parameter.unit = unit;
  parameter.lower = -most;
  parameter.upper = most;
  parameter.meaning = "fitted";
  return parameter;
}

// A bound that a person would write, well beyond the value.
double BoundFor(double value) {
  return std::pow(10.0, std::ceil(std::log10(std::max(std::abs(value) * 3, 1e-9))));
}

class Scorer {
 public:
  Scorer(const Experiment& experiment, const Fit& fit) : experiment_(experiment), fit_(fit) {
    // Only hypotheses of the surface that the data do not rule out already, with or without a term: all of
    // them; a term may take the surface's place.
    const Likelihood& likelihood = *experiment.likelihood;
    const int own = 1 + fit.model.size();
    std::vector<int> members(own);
    for (int i = 0; i < own; ++i) members[i] = i;
    base_ = Judge(likelihood, Grams(likelihood, fit.columns), members, fit.model.coordinates(), fit.point);
  }

  // Blocks of `width` columns: log likelihood and evidence gains of each.
  void Score(const Eigen::MatrixXd& columns, int width, const std::vector<double>& scales,
             std::vector<double>* evidence, std::vector<double>* log_ratio, Eigen::MatrixXd* step) const {
    const Likelihood& likelihood = *experiment_.likelihood;
    const Likelihood::Columns prepared = likelihood.Prepare(columns);
    const int blocks = static_cast<int>(columns.cols()) / width, p = fit_.model.size();
    const int surfaces = static_cast<int>(likelihood.surfaces().size());
    std::vector<double> best(blocks, -INFINITY), sum_e(blocks, 0), sum_l(blocks, 0);
    step->setZero(width, blocks);
    double most = 0;  // scale of the sums: the base
    most = base_.log_likelihood;
    for (int s = 0; s < surfaces; ++s) {
      const Eigen::MatrixXd own = likelihood.Gram(fit_.columns, s);
      const Eigen::MatrixXd cross = likelihood.Cross(fit_.columns, prepared, s);
      const Eigen::VectorXd norms = likelihood.Norms(prepared, s);
      // Without the fit's own directions.
      Eigen::MatrixXd jj = own.bottomRightCorner(p, p);
      for (int i = 0; i < p; ++i) jj(i, i) *= 1 + 1e-9, jj(i, i) += 1e-300;
      const Eigen::LDLT<Eigen::MatrixXd> solver(jj);
      const Eigen::VectorXd own_step =
          p > 0 ? Eigen::VectorXd(solver.solve(own.col(0).tail(p))) : Eigen::VectorXd();
      const double q = own(0, 0) - (p > 0 ? own.col(0).tail(p).dot(own_step) : 0);
      const Eigen::MatrixXd own_cross =
          p > 0 ? Eigen::MatrixXd(solver.solve(cross.bottomRows(p))) : Eigen::MatrixXd();
      Eigen::MatrixXd inner;
      if (width == 2) {
        inner.resize(1, blocks);
        const int l = likelihood.surfaces()[s].length_index;
        (void)l;
        for (int b = 0; b < blocks; ++b)
          inner(0, b) = likelihood.Cross(Likelihood::Pick(prepared, {2 * b}),
                                         Likelihood::Pick(prepared, {2 * b + 1}), s)(0, 0);
      }
      for (int b = 0; b < blocks; ++b) {
        Eigen::MatrixXd a(width, width);
        Eigen::VectorXd g(width);
        for (int i = 0; i < width; ++i) {
          const int ci = b * width + i;
          g[i] = cross(0, ci) - (p > 0 ? cross.col(ci).tail(p).dot(own_step) : 0);
          for (int j = 0; j < width; ++j) {
            const int cj = b * width + j;
            a(i, j) = i == j ? norms[ci] : inner(0, b);
            if (p > 0) a(i, j) -= cross.col(ci).tail(p).dot(own_cross.col(cj));
          }
          if (!(a(i, i) > 1e-6 * norms[ci])) a(i, i) = INFINITY;  // the fit has it already
        }
        if (!a.allFinite()) continue;
        for (int i = 0; i < width; ++i) a(i, i) *= 1 + 1e-9;
        const Eigen::VectorXd x = a.ldlt().solve(g);
        const double left = std::max(q - g.dot(x), 0.0);
        const double sigma = likelihood.Sigma(left, p + width);
        double occam = 0;
        for (int i = 0; i < width; ++i) {
          const double scale = scales[b * width + i];
          occam += 0.5 * std::log1p(a(i, i) * scale * scale / (sigma * sigma)) +
                   std::log1p(std::pow(x[i] / scale, 2));
        }
        const double log_likelihood = likelihood.LogPrior(s) + likelihood.LogLikelihood(left, s);
        sum_l[b] += std::exp(std::min(log_likelihood - most, 600.0));
        sum_e[b] += std::exp(std::min(log_likelihood - occam - most, 600.0));
        if (log_likelihood - occam > best[b]) best[b] = log_likelihood - occam, step->col(b) = x;
      }
    }
    evidence->resize(blocks);
    log_ratio->resize(blocks);
    for (int b = 0; b < blocks; ++b) {
      (*log_ratio)[b] = sum_l[b] > 0 ? std::log(sum_l[b]) : -INFINITY;
      (*evidence)[b] = sum_e[b] > 0 ? std::log(sum_e[b]) : -INFINITY;
      // Gains so large that the sums overflow are told by their best hypothesis alone.
      if (best[b] - most > 500) (*evidence)[b] = (*log_ratio)[b] = best[b] - most;
    }
  }

 private:
  const Experiment& experiment_;
  const Fit& fit_;
  Judgement base_;
};

}  // namespace

std::vector<FormulaTerm> ScoreTerms(const Experiment& experiment, const Fit& fit, const Prediction& d) {
  const Observations& o = *experiment.observations;
  const std::vector<TermFactor> factors = ListTermFactors(o, d);
  const std::vector<FingerFactor> fingers = ListFingerFactors(o, d);
  const double speed_m_s = o.set->speed_m_s[o.row[0]];
  const bool several_speeds = std::any_of(factors.begin(), factors.end(),
                                          [](const TermFactor& f) { return f.covariate == "speed_mm_s"; });
  const int rows = experiment.contrasts->rows();

  // Columns of time in s for k = 1 mm (of travel) or 1 us.
  std::vector<double> values(o.time_s.size());
  const auto column = [&](bool adds_time, const TermValue& value) {
    for (int k = 0; k < o.size(); ++k)
      for (int i = 0; i < o.fingers; ++i) {
        const size_t e = static_cast<size_t>(k) * o.fingers + i;
        const double size = value(k, i) * (adds_time ? 1e-6 : 1e-3 * d.slope_s_m[e]);
        values[e] = std::isfinite(size) ? size : 0;
      }
    return experiment.contrasts->Apply(values);
  };
  const auto scale_of = [&](const Eigen::VectorXd& c) {
    const double rms = std::sqrt(c.squaredNorm() / rows);
    return rms > 0 ? kTypicalTravelM / speed_m_s / rms : 1.0;
  };

  std::vector<FormulaTerm> terms;
  std::vector<double> prices, scales;
  Eigen::MatrixXd columns(rows, 0);
  std::vector<Eigen::VectorXd> list;
  for (const TermFactor& factor : factors)
    for (const FingerFactor& finger : fingers) {
      const bool plain = finger.expression.empty();
      if (plain && !factor.differs) continue;  // the same on every finger cannot be seen
      for (const bool adds_time : {false, true}) {
        if (adds_time && !several_speeds) continue;
        const Eigen::VectorXd c =
            column(adds_time, [&](int k, int i) { return factor.value(k, i) * finger.value(k, i); });
        if (!(c.norm() > 0)) continue;
        FormulaTerm term;
        term.covariate = factor.covariate;
        term.adds_time = adds_time;
        term.expression = absl::StrCat("k * ", finger.expression, plain ? "" : " * ", factor.expression);
        terms.push_back(std::move(term));
        list.push_back(c);
        scales.push_back(scale_of(c));
        prices.push_back(factor.price + (plain || !factor.differs ? 0 : kProductNats));
      }
    }
  columns.resize(rows, list.size());
  for (size_t c = 0; c < list.size(); ++c) columns.col(c) = list[c];
  const Scorer scorer(experiment, fit);
  std::vector<double> evidence, log_ratio;
  Eigen::MatrixXd step;
  scorer.Score(columns, 1, scales, &evidence, &log_ratio, &step);
  for (size_t c = 0; c < terms.size(); ++c) {
    terms[c].gain_nats = evidence[c] - prices[c];
    terms[c].log_ratio = log_ratio[c];
    const bool number =
        terms[c].covariate.rfind("approach", 0) == 0 || terms[c].covariate.rfind("lateral", 0) == 0 ||
        terms[c].covariate.rfind("normal", 0) == 0 || terms[c].expression.find("pi/180") != std::string::npos;
    const Unit unit = !number ? Unit::kNone : terms[c].adds_time ? Unit::kMicrosecond : Unit::kMillimetre;
    terms[c].parameters.push_back(Bounded("k", unit, BoundFor(step(0, c))));
    terms[c].values.push_back(step(0, c));
  }

  // Periodic in the travel: a lead screw, a gear.
  std::vector<FormulaTerm> periodic;
  list.clear(), scales.clear();
  for (int n = 0; n < kPeriods; ++n) {
    const double period_mm = kMinPeriodMm * std::pow(kMaxPeriodMm / kMinPeriodMm, n / (kPeriods - 1.0));
    for (const double shift : {0.0, 0.25}) {
      list.push_back(column(false, [&](int k, int i) {
        return std::sin(2 * kPi *
                        (d.travel_m[static_cast<size_t>(k) * o.fingers + i] * 1e3 / period_mm + shift));
      }));
      scales.push_back(scale_of(list.back()));
    }
    FormulaTerm term;
    term.covariate = "travel_mm";
    term.expression = "k * sin(2*pi*travel_mm/lead + phase)";
    term.values = {0, period_mm, 0};
    term.degrees = 3;
    periodic.push_back(std::move(term));
  }
  columns.resize(rows, list.size());
  for (size_t c = 0; c < list.size(); ++c) columns.col(c) = list[c];
  scorer.Score(columns, 2, scales, &evidence, &log_ratio, &step);
  for (int n = 0; n < kPeriods; ++n) {
    FormulaTerm& term = periodic[n];
    term.gain_nats = evidence[n] - kCurvedNats - std::log(static_cast<double>(kPeriods));
    term.log_ratio = log_ratio[n];
    const double k = std::hypot(step(0, n), step(1, n));
    term.values[0] = k;
    term.values[2] = std::atan2(step(1, n), step(0, n));
    term.parameters = {Bounded("k", Unit::kMillimetre, BoundFor(k)), Bounded("lead", Unit::kMillimetre, 0),
                       Bounded("phase", Unit::kNone, 7)};
    term.parameters[1].lower = 0.8 * term.values[1];
    term.parameters[1].upper = 1.25 * term.values[1];
  }
  terms.insert(terms.end(), periodic.begin(), periodic.end());
  std::stable_sort(terms.begin(), terms.end(),
                   [](const FormulaTerm& a, const FormulaTerm& b) { return a.gain_nats > b.gain_nats; });
  return terms;
}

absl::StatusOr<std::shared_ptr<const Effect>> MakeTermEffect(const std::string& name,
                                                             const FormulaTerm& term) {
  FormulaSpec spec;
  spec.name = name;
  spec.adds_time = term.adds_time;
  spec.stage = term.adds_time ? Stage::kSensor : Stage::kMotion;
  spec.expression = term.expression;
  spec.parameters = term.parameters;
  spec.values = term.values;
  return MakeFormulaEffect(spec);
}

FormulaTerm Sum(const FormulaTerm& a, const FormulaTerm& b) {
  FormulaTerm sum = a;
  std::string second = absl::StrCat(" ", b.expression, " ");
  for (size_t p = 0; p < b.parameters.size(); ++p) {
    ParameterInfo parameter = b.parameters[p];
    const std::string renamed = parameter.name + "2";
    // Names stand between blanks or next to operators; no variable ends in them alone.
    second = absl::StrReplaceAll(second,
                                 {{absl::StrCat(" ", parameter.name, " "), absl::StrCat(" ", renamed, " ")},
                                  {absl::StrCat("/", parameter.name, " "), absl::StrCat("/", renamed, " ")},
                                  {absl::StrCat(" ", parameter.name, ")"), absl::StrCat(" ", renamed, ")")}});
    parameter.name = renamed;
    sum.parameters.push_back(parameter);
    sum.values.push_back(b.values[p]);
  }
  while (!second.empty() && second.back() == ' ') second.pop_back();
  sum.expression = absl::StrCat(a.expression, " +", second);
  sum.degrees += b.degrees;
  return sum;
}

}  // namespace touchstone
