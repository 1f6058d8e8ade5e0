#include "server/diagnosis/formula_terms.h"

#include <Eigen/Cholesky>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "server/base/text.h"
#include "server/effects/formula.h"

namespace touchstone {
namespace {

// The size of a term that rigs show: scale of the prior.
constexpr double kTypicalTravelM = 0.2e-3;
constexpr int kPeriods = 40;
constexpr double kLeastPeriodMm = 1.5, kMostPeriodMm = 40;
// The expression of a term may be long; what people would try first comes cheaper.
constexpr double kSimpleNats = 0, kCurvedNats = 1.5, kProductNats = 2;

double ThreeDigits(double value) {
  if (value == 0) return 0;
  const double unit = std::pow(10.0, std::floor(std::log10(std::abs(value))) - 2);
  return unit >= 1 ? std::round(value / unit) * unit : std::round(value / unit) / std::round(1 / unit);
}

using Value = std::function<double(int k, int finger)>;

// A covariate or a function of one.
struct Factor {
  std::string covariate;
  std::string expression;
  bool differs;  // between the fingers of a touch
  double price;
  Value value;
};

struct FingerFactor {
  std::string expression;  // empty: 1
  Value value;
};

std::vector<Factor> ListFactors(const Observations& o, const Prediction& d) {
  std::vector<Factor> factors;
  const MeasurementSet& set = *o.set;
  const auto at = [&o](int k, int i) { return static_cast<size_t>(k) * o.fingers + i; };
  const auto add = [&](const std::string& covariate, const std::string& expression, bool differs,
                       double price, Value value) {
    factors.push_back({covariate, expression, differs, price, std::move(value)});
  };
  const auto with_square = [&](const std::string& name, bool differs, const Value& value) {
    add(name, name, differs, kSimpleNats, value);
    add(name, name + "^2", differs, kCurvedNats, [value](int k, int i) {
      const double x = value(k, i);
      return x * x;
    });
  };

  for (int axis = 0; axis < 3; ++axis) {
    const std::string letter(1, "xyz"[axis]);
    with_square("approach_" + letter, false, [&, axis](int k, int) { return set.approach[o.row[k]][axis]; });
    with_square("lateral_" + letter, false, [&, axis](int k, int) { return set.lateral[o.row[k]][axis]; });
    with_square("normal_" + letter, true, [&d, at, axis](int k, int i) { return d.normal[at(k, i)][axis]; });
    const Value contact_mm = [&d, at, axis](int k, int i) { return d.contact_m[at(k, i)][axis] * 1e3; };
    with_square("contact_" + letter + "_mm", true, contact_mm);
  }

  // Travel, about its middle where it is squared: far from zero a square is all but a line.
  double mean_mm = 0;
  int counted = 0;
  for (const double travel : d.travel_m)
    if (!std::isnan(travel)) mean_mm += travel * 1e3, ++counted;
  mean_mm = std::round(mean_mm / std::max(counted, 1));
  const Value travel_mm = [&d, at](int k, int i) { return d.travel_m[at(k, i)] * 1e3; };
  add("travel_mm", "travel_mm", true, kSimpleNats, travel_mm);
  add("travel_mm", absl::StrCat("(travel_mm - ", ShortestNumber(mean_mm), ")^2"), true, kCurvedNats,
      [travel_mm, mean_mm](int k, int i) { return std::pow(travel_mm(k, i) - mean_mm, 2); });
  add("travel_mm", absl::StrCat("abs(travel_mm - ", ShortestNumber(mean_mm), ")"), true, kCurvedNats,
      [travel_mm, mean_mm](int k, int i) { return std::abs(travel_mm(k, i) - mean_mm); });

  const Value cosine = [&d, at](int k, int i) { return std::clamp(d.cos_incidence[at(k, i)], 0.1, 1.0); };
  const Value tangent = [cosine](int k, int i) { return std::sqrt(1 / std::pow(cosine(k, i), 2) - 1); };
  add("incidence_deg", "tan(incidence_deg*pi/180)", true, kSimpleNats, tangent);
  add("incidence_deg", "tan(incidence_deg*pi/180)^2", true, kSimpleNats,
      [tangent](int k, int i) { return std::pow(tangent(k, i), 2); });
  add("incidence_deg", "(1/cos(incidence_deg*pi/180) - 1)", true, kCurvedNats,
      [cosine](int k, int i) { return 1 / cosine(k, i) - 1; });
  add("incidence_deg", "incidence_deg", true, kSimpleNats,
      [cosine](int k, int i) { return std::acos(cosine(k, i)) * 180 / kPi; });
  add("incidence_deg", "sin(incidence_deg*pi/180)", true, kSimpleNats,
      [cosine](int k, int i) { return std::sqrt(1 - std::pow(cosine(k, i), 2)); });
  if (!d.curvature_per_m.empty())
    with_square("curvature_per_m", true, [&d, at](int k, int i) { return d.curvature_per_m[at(k, i)]; });

  // What happens only when a certain finger is first.
  const double middle = 0.5 * (o.fingers - 1);
  for (int finger = 0; finger < o.fingers; ++finger)
    add("first_finger", absl::StrCat("(first_finger == ", ShortestNumber(finger - middle), ")"), false,
        kSimpleNats, [&d, finger](int k, int) { return d.first_finger[k] == finger ? 1.0 : 0.0; });
  add("first_finger", "first_finger", false, kSimpleNats,
      [&d, middle](int k, int) { return d.first_finger[k] - middle; });
  with_square("previous_press_mm", true,
              [&d, at](int k, int i) { return d.previous_press_m[at(k, i)] * 1e3; });
  const auto varies = [&](const std::vector<double>& column) {
    return !column.empty() &&
           *std::max_element(column.begin(), column.end()) > *std::min_element(column.begin(), column.end());
  };
  if (varies(set.speed_m_s)) {
    const Value speed_mm_s = [&](int k, int) { return set.speed_m_s[o.row[k]] * 1e3; };
    with_square("speed_mm_s", false, speed_mm_s);
    add("speed_mm_s", "1/speed_mm_s", false, kSimpleNats,
        [speed_mm_s](int k, int i) { return 1 / speed_mm_s(k, i); });
  }
  // Conditions stand far from zero, and their effect was put to zero somewhere in the middle.
  const auto centred = [&](const std::string& name, const std::vector<double>& column) {
    if (!varies(column)) return;
    double sum = 0;
    for (const double x : column) sum += x;
    const double mean = ThreeDigits(sum / static_cast<double>(column.size()));
    const std::string text =
        absl::StrCat("(", name, mean < 0 ? " + " : " - ", ShortestNumber(std::abs(mean)), ")");
    const std::vector<double>* values = &column;
    const Value plain = [&o, values](int k, int) { return (*values)[o.row[k]]; };
    const Value shifted = [plain, mean](int k, int i) { return plain(k, i) - mean; };
    add(name, name, false, kSimpleNats, plain);
    if (mean == 0) return;
    add(name, text, false, kSimpleNats, shifted);
    add(name, text + "^2", false, kCurvedNats,
        [shifted](int k, int i) { return shifted(k, i) * shifted(k, i); });
  };
  if (set.has_session_time) centred("session_time_s", set.session_time_s);
  for (const auto& [name, column] : set.covariates) centred(name, column);
  return factors;
}

std::vector<FingerFactor> ListFingerFactors(const Observations& o, const Prediction& d) {
  std::vector<FingerFactor> factors;
  const double middle = 0.5 * (o.fingers - 1);
  factors.push_back({"", [](int, int) { return 1.0; }});
  factors.push_back({"finger", [middle](int, int i) { return i - middle; }});
  for (int finger = 0; finger < o.fingers; ++finger)
    factors.push_back({absl::StrCat("(finger == ", ShortestNumber(finger - middle), ")"),
                       [finger](int, int i) { return i == finger ? 1.0 : 0.0; }});
  if (o.fingers > 3)
    factors.push_back({"finger^2", [middle](int, int i) { return (i - middle) * (i - middle); }});
  factors.push_back({"first", [&d](int k, int i) { return d.first_finger[k] == i ? 1.0 : 0.0; }});
  return factors;
}

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
  const std::vector<Factor> factors = ListFactors(o, d);
  const std::vector<FingerFactor> fingers = ListFingerFactors(o, d);
  const double speed_m_s = o.set->speed_m_s[o.row[0]];
  const bool several_speeds = std::any_of(factors.begin(), factors.end(),
                                          [](const Factor& f) { return f.covariate == "speed_mm_s"; });
  const int rows = experiment.contrasts->rows();

  // Columns of time in s for k = 1 mm (of travel) or 1 us.
  std::vector<double> values(o.time_s.size());
  const auto column = [&](bool adds_time, const Value& value) {
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
  for (const Factor& factor : factors)
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
    const double period_mm = kLeastPeriodMm * std::pow(kMostPeriodMm / kLeastPeriodMm, n / (kPeriods - 1.0));
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
