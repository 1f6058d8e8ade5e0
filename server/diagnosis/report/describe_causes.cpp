// The report's ranking of single causes, and what is left when no cause of the catalogue explains it.
#include <Eigen/QR>

#include <absl/strings/str_cat.h>
#include <boost/math/special_functions/gamma.hpp>

#include <algorithm>
#include <cmath>
#include <map>

#include "server/base/status.h"
#include "server/diagnosis/selection/ladder.h"

namespace touchstone {
namespace {

constexpr int kRanked = 8;  // candidates that are fitted in full
constexpr int kMaxCovariates = 6;
constexpr double kCovariateP = 0.01;
constexpr char kUnseen[] = "this experiment cannot see it";
constexpr char kNeutral[] = "fits best where it changes nothing";

// Whether every value of the effect ended at its neutral, usually a bound.
bool ChangesNothing(const Fit& fit, int index) {
  for (int i = 0; i < fit.model.size(); ++i) {
    const Coordinate& c = fit.model.coordinates()[i];
    if (c.effect == index && std::abs(fit.point[i] - c.neutral) > 1e-9 * c.scale) return false;
  }
  return true;
}

// Cosine between a column and the nearest point of the span of others, all without `own`.
double Cosine(const Eigen::MatrixXd& own, const Eigen::VectorXd& column, const Eigen::MatrixXd& span) {
  const auto without = [&](const Eigen::MatrixXd& values) -> Eigen::MatrixXd {
    if (own.cols() == 0) return values;
    return values - own * own.colPivHouseholderQr().solve(values);
  };
  const Eigen::VectorXd c = without(column);
  const Eigen::MatrixXd s = without(span);
  if (!(c.norm() > 0) || !(s.norm() > 0)) return 0;
  return (s * s.colPivHouseholderQr().solve(c)).norm() / c.norm();
}

// "formula: ..." as it stands in a model file.
std::string FormulaYaml(const Fit& fit, int index) {
  Model only = fit.model.base();
  only.effects = {only.effects[index]};
  EffectInstance& instance = only.effects[0];
  size_t at_value = 0;  // a formula's parameters are numbers
  for (const v1::ParameterValue& value : fit.model.Describe(index, fit.point, fit.covariance)) {
    const ParameterInfo& parameter = instance.effect->parameters[at_value];
    instance.values[at_value++] = ToSi(parameter.unit, RoundedTo(value.value(), value.std_error()));
  }
  const std::string text = FormatModel(only);
  const size_t at = text.find("effects:");
  const size_t line = at == std::string::npos ? std::string::npos : text.find('\n', at);
  return line == std::string::npos ? text : text.substr(line + 1);
}

}  // namespace

absl::Status DescribeCandidates(const Study& study, const Explained& explained, v1::Report* report) {
  const Search& search = *explained.search;
  const Fit& given = explained.given;
  TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<Move> moves, search.Score(given, explained.given_effects));
  std::stable_sort(moves.begin(), moves.end(),
                   [](const Move& a, const Move& b) { return a.evidence > b.evidence; });
  std::vector<v1::Candidate> candidates;
  double all = 1;  // nothing is missing: evidence 0
  int fitted = 0;
  for (const Move& move : moves) {
    if (move.candidate < 0) continue;
    v1::Candidate candidate;
    candidate.set_effect(move.name);
    candidate.set_scope(search.candidates()[move.candidate].per_object ? "object" : "rig");
    if (!move.visible) {
      candidate.set_note(kUnseen);
      candidates.push_back(std::move(candidate));
      continue;
    }
    candidate.set_gain_nats(move.evidence - given.evidence);
    if (fitted < kRanked) {
      ++fitted;
      TOUCHSTONE_ASSIGN_OR_RETURN(const Fit fit, search.FitMove(move));
      candidate.set_gain_nats(fit.evidence - given.evidence);
      const int index = static_cast<int>(fit.model.base().effects.size()) - 1;
      if (ChangesNothing(fit, index)) {
        candidate.set_gain_nats(0);
        candidate.set_note(kNeutral);
        candidates.push_back(std::move(candidate));
        continue;
      }
      for (v1::ParameterValue& value : fit.model.Describe(index, fit.point, fit.covariance))
        *candidate.add_parameters() = std::move(value);
      const Eigen::VectorXd r = fit.columns.values.col(0);
      candidate.set_rmse_us(std::sqrt(r.squaredNorm() / std::max<double>(1, static_cast<double>(r.size()))) *
                            1e6);
      candidate.set_heldout_rmse_us(search.HeldoutRmse(fit) * 1e6);
    } else {
      candidate.set_note("not among the eight most probable; its gain is a linear forecast");
    }
    all += std::exp(std::min(candidate.gain_nats(), 600.0));
    candidates.push_back(std::move(candidate));
  }
  const auto explains = [](const v1::Candidate& c) { return c.note() != kUnseen && c.note() != kNeutral; };
  for (v1::Candidate& candidate : candidates)
    if (explains(candidate))
      candidate.set_probability(std::exp(std::min(candidate.gain_nats(), 600.0)) / all);
  std::stable_sort(candidates.begin(), candidates.end(), [&](const v1::Candidate& a, const v1::Candidate& b) {
    return explains(a) != explains(b) ? explains(a) : a.gain_nats() > b.gain_nats();
  });
  for (v1::Candidate& candidate : candidates) *report->add_candidates() = std::move(candidate);
  return absl::OkStatus();
}

absl::Status DescribeUnexplained(const Study& study, const Explained& explained, double floor_us,
                                 v1::Report* report) {
  v1::Unexplained* unexplained = report->mutable_unexplained();
  std::vector<FormulaTerm> terms = explained.terms;
  if (terms.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const Prediction details,
                                study.searched_predictor->Run(explained.fit.model.base(), true, true));
    terms = ScoreTerms(study.experiment, explained.fit, details);
  }

  // Each covariate by its best term, the number of terms paid for.
  std::map<std::string, v1::CovariateTest> tests;
  for (const FormulaTerm& term : terms) {
    const double tail = boost::math::gamma_q(0.5 * term.degrees, std::max(term.log_ratio, 0.0));
    const double p = std::min(1.0, tail * static_cast<double>(terms.size()));
    v1::CovariateTest& test = tests[term.covariate];
    if (!test.name().empty() && test.gain_nats() >= term.gain_nats) continue;
    test.set_name(term.covariate);
    test.set_p(p);
    test.set_gain_nats(term.gain_nats);
  }
  std::vector<v1::CovariateTest> sorted;
  for (auto& [name, test] : tests) sorted.push_back(std::move(test));
  std::stable_sort(sorted.begin(), sorted.end(), [](const v1::CovariateTest& a, const v1::CovariateTest& b) {
    return a.gain_nats() > b.gain_nats();
  });
  if (explained.formula >= 0)  // what the formula is made of stands first
    std::stable_partition(sorted.begin(), sorted.end(), [&](const v1::CovariateTest& test) {
      return test.name() == explained.term.covariate;
    });
  for (const v1::CovariateTest& test : sorted)
    if (unexplained->covariates_size() < kMaxCovariates && test.p() < kCovariateP)
      *unexplained->add_covariates() = test;
  if (explained.formula < 0) return absl::OkStatus();

  // The formula, its values, and what it would do.
  const Fit& fit = explained.fit;
  const EffectInstance& instance = fit.model.base().effects[explained.formula];
  unexplained->set_formula(instance.effect->formula->expression);
  unexplained->set_formula_yaml(FormulaYaml(fit, explained.formula));
  for (v1::ParameterValue& value : fit.model.Describe(explained.formula, fit.point, fit.covariance))
    *unexplained->add_parameters() = std::move(value);
  TOUCHSTONE_ASSIGN_OR_RETURN(const Prediction with, study.predictor->Run(fit.model.base(), false, false));
  const v1::Quality quality =
      QualityOf(study, *explained.search, fit, Residuals(*study.observations, with), false);
  unexplained->set_rmse_us(quality.rmse_us());
  unexplained->set_heldout_rmse_us(quality.heldout_rmse_us());
  const double before = std::pow(report->final().heldout_rmse_us(), 2) - floor_us * floor_us;
  const double after = std::pow(quality.heldout_rmse_us(), 2) - floor_us * floor_us;
  unexplained->set_heldout_gain(before > 0 ? std::clamp(1 - after / before, 0.0, 1.0) : 0);

  // What of the catalogue looks most like it.
  const int own = explained.without_formula.model.size();
  const Eigen::MatrixXd others = explained.without_formula.columns.values.rightCols(own);
  Eigen::VectorXd column;
  for (int i = 0; i < fit.model.size(); ++i)
    if (fit.model.coordinates()[i].effect == explained.formula && column.size() == 0)
      column = fit.columns.values.col(1 + i);
  if (column.size() == 0) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<Move> moves,
                              explained.search->Score(explained.without_formula, explained.given_effects));
  for (const Move& move : moves) {
    if (move.candidate < 0 || !move.visible) continue;
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const Eigen::MatrixXd span,
        Derivatives(study.experiment, move.start, move.start.Start(), explained.without_formula.time_s, own));
    if (span.cols() > 8) continue;  // object by object: looks like anything
    const double cosine = Cosine(others, column, span);
    if (cosine <= unexplained->nearest_cosine()) continue;
    unexplained->set_nearest_cosine(cosine);
    unexplained->set_nearest_effect(move.name);
  }
  return absl::OkStatus();
}

}  // namespace touchstone
