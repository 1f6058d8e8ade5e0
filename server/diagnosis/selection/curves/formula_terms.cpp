#include "server/diagnosis/selection/curves/formula_terms.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>

#include <algorithm>
#include <cmath>

#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/diagnosis/selection/curves/rules.h"
#include "server/diagnosis/selection/curves/term_factors.h"
#include "server/diagnosis/selection/curves/term_scores.h"
#include "server/effects/formula/formula.h"

namespace touchstone::diagnosis::selection {
namespace {

model::ParameterInfo Bounded(const std::string& name, Unit unit, double bound) {
  model::ParameterInfo parameter;
  parameter.name = name;
  parameter.unit = unit;
  parameter.lower = -bound;
  parameter.upper = bound;
  parameter.meaning = "fitted";
  return parameter;
}

// A bound that a person would write, well beyond the value.
double BoundFor(double value) {
  return std::pow(10.0, std::ceil(std::log10(std::max(std::abs(value) * 3, 1e-9))));
}

// Terms with their columns: of time in s for a value of 1 in the units of files.
class TermTable {
 public:
  TermTable(const touches::TouchObservationModel& touches, const touches::Prediction& details)
      : touches_(touches), o_(touches.observations()), d_(details), values_(o_.time_s.size()) {}

  // The rows of a value that is multiplied by k = 1 mm (of travel) or 1 us.
  Eigen::VectorXd Column(bool adds_time, const TermValue& value) {
    for (int k = 0; k < o_.size(); ++k)
      for (int i = 0; i < o_.fingers; ++i) {
        const size_t e = static_cast<size_t>(k) * o_.fingers + i;
        const double size = value(k, i) * (adds_time ? kSecondsPerMicrosecond
                                                     : kMetresPerMillimetre * d_.inverse_speed_s_per_m[e]);
        values_[e] = std::isfinite(size) ? size : 0;
      }
    return touches_.contrasts().Apply(values_);
  }

  void Add(const Eigen::VectorXd& column) {
    columns_.push_back(column);
    const double rms = std::sqrt(column.squaredNorm() / touches_.rows());
    const double speed_m_s = o_.set->speed_m_s[o_.row[0]];
    scales_.push_back(rms > 0 ? kCurveRules.typical_travel.value() / speed_m_s / rms : 1.0);
  }

  TermScores Score(const TermScorer& scorer, int width) const {
    Eigen::MatrixXd columns(touches_.rows(), columns_.size());
    for (size_t c = 0; c < columns_.size(); ++c) columns.col(c) = columns_[c];
    return scorer.Score(columns, width, scales_);
  }

 private:
  const touches::TouchObservationModel& touches_;
  const touches::Observations& o_;
  const touches::Prediction& d_;
  std::vector<double> values_;
  std::vector<Eigen::VectorXd> columns_;
  std::vector<double> scales_;
};

// Of k, in a term of one factor: a length or a time where the factor is a ratio; other products get no unit.
Unit UnitOfFactor(const FormulaTerm& term) {
  const auto about = [&](const char* prefix) { return term.covariate.rfind(prefix, 0) == 0; };
  const bool ratio = about("approach") || about("lateral") || about("normal") ||
                     (about("incidence") && term.expression.find("pi/180") != std::string::npos);
  return !ratio ? Unit::kNone : term.adds_time ? Unit::kMicrosecond : Unit::kMillimetre;
}

// A factor of the fingers times a covariate or a function of one.
std::vector<FormulaTerm> ScoreProducts(const TermScorer& scorer,
                                       const touches::TouchObservationModel& touches,
                                       const touches::Prediction& d) {
  const touches::Observations& o = touches.observations();
  const std::vector<TermFactor> factors = ListTermFactors(o, d);
  const bool several_speeds = std::any_of(factors.begin(), factors.end(),
                                          [](const TermFactor& f) { return f.covariate == "speed_mm_s"; });
  TermTable table(touches, d);
  std::vector<FormulaTerm> terms;
  std::vector<double> penalties;
  for (const TermFactor& factor : factors)
    for (const FingerFactor& finger : ListFingerFactors(o, d)) {
      const bool plain = finger.expression.empty();
      if (plain && !factor.differs) continue;  // the same on every finger cannot be seen
      for (const bool adds_time : {false, true}) {
        if (adds_time && !several_speeds) continue;
        const Eigen::VectorXd column =
            table.Column(adds_time, [&](int k, int i) { return factor.value(k, i) * finger.value(k, i); });
        if (!(column.norm() > 0)) continue;
        FormulaTerm term;
        term.covariate = factor.covariate;
        term.adds_time = adds_time;
        term.expression = absl::StrCat("k * ", finger.expression, plain ? "" : " * ", factor.expression);
        terms.push_back(std::move(term));
        table.Add(column);
        penalties.push_back(factor.penalty_nats +
                            (plain || !factor.differs ? 0 : kCurveRules.product.value()));
      }
    }
  const TermScores scores = table.Score(scorer, 1);
  for (size_t c = 0; c < terms.size(); ++c) {
    terms[c].gain_nats = scores.log_evidence[c] - penalties[c];
    terms[c].log_ratio = scores.log_ratio[c];
    terms[c].parameters.push_back(Bounded("k", UnitOfFactor(terms[c]), BoundFor(scores.step(0, c))));
    terms[c].values.push_back(scores.step(0, c));
  }
  return terms;
}

// Periodic in the travel: a lead screw, a gear.
std::vector<FormulaTerm> ScorePeriods(const TermScorer& scorer, const touches::TouchObservationModel& touches,
                                      const touches::Prediction& d) {
  const int fingers = touches.observations().fingers;
  TermTable table(touches, d);
  std::vector<FormulaTerm> terms;
  for (int n = 0; n < kCurveRules.periods; ++n) {
    const double period_mm =
        kCurveRules.min_period *
        std::pow(kCurveRules.max_period / kCurveRules.min_period, n / (kCurveRules.periods - 1.0));
    for (const double shift : {0.0, 0.25})
      table.Add(table.Column(false, [&](int k, int i) {
        const double travel_mm = d.travel_m[static_cast<size_t>(k) * fingers + i] * kMillimetresPerMetre;
        return std::sin(2 * kPi * (travel_mm / period_mm + shift));
      }));
    FormulaTerm term;
    term.covariate = "travel_mm";
    term.expression = "k * sin(2*pi*travel_mm/lead + phase)";
    term.values = {0, period_mm, 0};
    term.degrees_of_freedom = 3;
    terms.push_back(std::move(term));
  }
  const TermScores scores = table.Score(scorer, 2);
  for (int n = 0; n < kCurveRules.periods; ++n) {
    FormulaTerm& term = terms[n];
    term.gain_nats = scores.log_evidence[n] - kCurveRules.curved -
                     std::log(static_cast<double>(kCurveRules.periods.value()));
    term.log_ratio = scores.log_ratio[n];
    const double k = std::hypot(scores.step(0, n), scores.step(1, n));
    term.values[0] = k;
    term.values[2] = std::atan2(scores.step(1, n), scores.step(0, n));
    term.parameters = {Bounded("k", Unit::kMillimetre, BoundFor(k)), Bounded("lead", Unit::kMillimetre, 0),
                       Bounded("phase", Unit::kNone, 7)};
    term.parameters[1].lower = 0.8 * term.values[1];
    term.parameters[1].upper = 1.25 * term.values[1];
  }
  return terms;
}

}  // namespace

std::vector<FormulaTerm> ScoreTerms(const engine::Experiment& experiment,
                                    const touches::TouchObservationModel& touches, const engine::Fit& fit,
                                    const touches::Prediction& details) {
  const TermScorer scorer(experiment, fit);
  std::vector<FormulaTerm> terms = ScoreProducts(scorer, touches, details);
  const std::vector<FormulaTerm> periodic = ScorePeriods(scorer, touches, details);
  terms.insert(terms.end(), periodic.begin(), periodic.end());
  std::stable_sort(terms.begin(), terms.end(),
                   [](const FormulaTerm& a, const FormulaTerm& b) { return a.gain_nats > b.gain_nats; });
  return terms;
}

std::string NameOfRest(const std::string& covariate) {
  return ("rest_" + covariate).substr(0, 60);
}

absl::StatusOr<std::shared_ptr<const model::Effect>> MakeTermEffect(const std::string& name,
                                                                    const FormulaTerm& term) {
  model::FormulaSpec spec;
  spec.name = name;
  spec.adds_time = term.adds_time;
  spec.stage = term.adds_time ? model::Stage::kSensor : model::Stage::kMotion;
  spec.expression = term.expression;
  spec.parameters = term.parameters;
  spec.values = term.values;
  return effects::MakeFormulaEffect(spec);
}

FormulaTerm Sum(const FormulaTerm& a, const FormulaTerm& b) {
  FormulaTerm sum = a;
  std::string second = absl::StrCat(" ", b.expression, " ");
  for (size_t p = 0; p < b.parameters.size(); ++p) {
    model::ParameterInfo parameter = b.parameters[p];
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
  sum.degrees_of_freedom += b.degrees_of_freedom;
  return sum;
}

}  // namespace touchstone::diagnosis::selection
