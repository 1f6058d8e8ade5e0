#include "server/diagnosis/engine/competition/competition.h"

#include <algorithm>
#include <cmath>

#include "server/base/numbers/decompositions.h"
#include "server/base/numbers/distributions.h"
#include "server/base/status.h"
#include "server/diagnosis/engine/competition/rules.h"
#include "server/diagnosis/engine/fit/laplace_evidence.h"

namespace touchstone::diagnosis::engine {
namespace {

Eigen::MatrixXd ColumnsOf(const Fit& fit, int effect) {
  Eigen::MatrixXd columns(fit.columns.values.rows(), 0);
  for (int i = 0; i < fit.model.size(); ++i) {
    if (fit.model.parameters()[i].effect != effect) continue;
    columns.conservativeResize(Eigen::NoChange, columns.cols() + 1);
    columns.rightCols(1) = fit.columns.values.col(1 + i);
  }
  return columns;
}

// Whether the other effect moves the rows as this one does, however far.
bool ActsAlike(const Fit& fit, int effect, const Fit& other_fit, int other) {
  const Eigen::MatrixXd own = ColumnsOf(fit, effect), span = ColumnsOf(other_fit, other);
  if (own.cols() == 0 || span.cols() == 0 || own.rows() != span.rows()) return false;
  const Eigen::MatrixXd outside = own - span * SolveLeastSquaresColumns(span, own);
  return outside.norm() < kCompetitionRules.alike * own.norm();
}

// Whether the data cannot tell a competitor from effect `index`.
class Equivalence {
 public:
  Equivalence(const StepwiseSearch& search, const Explanation& whole, int index, double gain_nats)
      : search_(search),
        whole_(whole),
        index_(index),
        gain_nats_(gain_nats),
        own_(*whole.fit.model.base().effects[index].effect) {}

  // As probable, or as likely with no more parameters, whatever rigs usually show; with more of them if it is known to
  // hold this effect as a part; or stopped by its bound and nothing else.
  void Assess(const CompetingFit& other, CompetingEffect* found) const {
    const Fit& fit = whole_.fit;
    const double evidence = found->relative_log_evidence;
    const bool declared = IsDeclaredConfounded(own_, other.name);
    const bool as_likely =
        other.fit.log_likelihood > fit.log_likelihood - kCompetitionRules.same_likelihood_nats;
    const int added = static_cast<int>(other.fit.model.base().effects.size()) - 1;
    found->stopped = declared && added >= whole_.initial_effects && IsAtBound(other.fit, added) &&
                     !IsAtBound(fit, index_) && ActsAlike(fit, index_, other.fit, added);
    found->equivalent = evidence > -search_.rules().equivalent_nats ||
                        (as_likely && (declared || other.fit.model.size() <= fit.model.size())) ||
                        found->stopped ||
                        (declared && search_.observations().HasRoughDerivatives(own_) &&
                         evidence > -kCompetitionRules.clear_share * gain_nats_);
  }

 private:
  const StepwiseSearch& search_;
  const Explanation& whole_;
  int index_;
  double gain_nats_;
  const model::Effect& own_;
};

absl::StatusOr<SelectedStep> AssessStep(const StepwiseSearch& search, const Explanation& whole, int index,
                                        const std::map<std::string, NamelessRival>& rivals) {
  const Fit& fit = whole.fit;
  SelectedStep step;
  step.effect = index;
  TOUCHSTONE_ASSIGN_OR_RETURN(const Fit without, search.WithoutEffect(whole, index));
  step.gain_nats = fit.log_evidence - without.log_evidence;
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<CompetingFit> competing, search.CompetingFits(whole, index));
  const std::string own = NameOf(*fit.model.base().effects[index].effect);
  const std::string own_object = fit.model.OnlyObject(index);
  const Equivalence equivalence(search, whole, index, step.gain_nats);
  // Log evidence over the step's own: that nothing takes its place, what else could, what is equivalent.
  std::vector<double> all = {-step.gain_nats}, same_or_equivalent;
  for (const CompetingFit& other : competing) {
    CompetingEffect found = {
        other.name, other.per_object, other.object, other.fit.log_evidence - fit.log_evidence, false, false,
        {}};
    equivalence.Assess(other, &found);
    const bool same = other.name == own && other.object == own_object;
    all.push_back(found.relative_log_evidence);
    if (same || found.equivalent) same_or_equivalent.push_back(found.relative_log_evidence);
    if (same || other.nameless) continue;
    found.model = other.fit.model.base();
    step.competing.push_back(std::move(found));
  }
  if (const auto rival = rivals.find(own); rival != rivals.end()) {
    all.push_back(rival->second.ahead_nats);
    if (rival->second.ahead_nats > -kCompetitionRules.worth_saying_nats) step.words = rival->second.words;
  }
  step.probability = ProbabilityAmong(same_or_equivalent, all);
  return step;
}

}  // namespace

absl::StatusOr<std::vector<SelectedStep>> FindCompetitors(
    const StepwiseSearch& search, const Explanation& whole, int nameless,
    const std::map<std::string, NamelessRival>& rivals) {
  std::vector<SelectedStep> steps;
  for (int index = whole.initial_effects; index < static_cast<int>(whole.fit.model.base().effects.size());
       ++index) {
    if (index == nameless) continue;
    TOUCHSTONE_ASSIGN_OR_RETURN(SelectedStep step, AssessStep(search, whole, index, rivals));
    steps.push_back(std::move(step));
  }
  return steps;
}

ExplanationsLeft FindExplanationsLeft(const Fit& fit, const std::vector<SelectedStep>& steps,
                                      const model::Model& best) {
  const auto hardest = [](const SelectedStep& one, const SelectedStep& other) {
    const CompetingEffect &a = one.competing[0], &b = other.competing[0];
    return a.equivalent != b.equivalent ? a.equivalent : a.relative_log_evidence > b.relative_log_evidence;
  };
  const SelectedStep* closest = nullptr;
  for (const SelectedStep& step : steps)
    if (!step.competing.empty() && (closest == nullptr || hardest(step, *closest))) closest = &step;
  ExplanationsLeft left;
  const auto whole = std::make_shared<const model::Model>(best);
  if (closest == nullptr) {
    left.models.push_back({"the model as it is", whole});
    return left;
  }
  left.models.push_back({NameOf(*fit.model.base().effects[closest->effect].effect), whole});
  for (const CompetingEffect& other : closest->competing) {
    left.confounded |= other.equivalent;
    if (!other.equivalent && left.models.size() > 1) break;
    if (left.models.size() == kCompetitionRules.max_left) break;
    left.models.push_back({other.name, std::make_shared<const model::Model>(other.model)});
  }
  return left;
}

bool IsAtBound(const Fit& fit, int index) {
  for (int i = 0; i < fit.model.size(); ++i) {
    const FreeParameter& p = fit.model.parameters()[i];
    const double near = kCompetitionRules.value_tolerance * p.scale;
    if (p.effect != index || std::abs(fit.point[i] - p.neutral) <= near) continue;
    if (fit.point[i] <= p.lower + near || fit.point[i] >= p.upper - near) return true;
  }
  return false;
}

bool ChangesNothing(const Fit& fit, int index) {
  for (int i = 0; i < fit.model.size(); ++i) {
    const FreeParameter& p = fit.model.parameters()[i];
    if (p.effect == index && std::abs(fit.point[i] - p.neutral) > 1e-9 * p.scale) return false;
  }
  return true;
}

double ProbabilityOfShare(double log_share) {
  return std::min(kCompetitionRules.max_probability.value(), std::exp(log_share));
}

void PutFirst(CovariateTest test, UnexplainedRest* rest) {
  std::vector<CovariateTest>& tests = rest->covariates;
  const auto same = std::find_if(tests.begin(), tests.end(),
                                 [&](const CovariateTest& other) { return other.name == test.name; });
  if (same != tests.end()) {
    test = *same;
    tests.erase(same);
  }
  tests.insert(tests.begin(), std::move(test));
}

double ProbabilityAmong(const std::vector<double>& same, const std::vector<double>& all) {
  return ProbabilityOfShare(LogSum(same) - LogSum(all));
}

double ProbabilityOf(double log_odds) {
  return ProbabilityOfShare(-std::log1p(std::exp(-log_odds)));
}

double NeutralP(const Parameterization& model, int effect, const Eigen::VectorXd& point,
                const Eigen::MatrixXd& covariance) {
  std::vector<int> own;
  for (int i = 0; i < model.size(); ++i)
    if (model.parameters()[i].effect == effect) own.push_back(i);
  const int n = static_cast<int>(own.size());
  Eigen::VectorXd value(n);
  Eigen::MatrixXd part(n, n);
  for (int a = 0; a < n; ++a) {
    value[a] = point[own[a]] - model.parameters()[own[a]].neutral;
    for (int b = 0; b < n; ++b) part(a, b) = covariance(own[a], own[b]);
  }
  return WaldP(value, part);
}

double WaldP(const Eigen::VectorXd& difference, const Eigen::MatrixXd& covariance) {
  std::vector<int> known;
  for (int i = 0; i < difference.size(); ++i)
    if (covariance(i, i) > 0) known.push_back(i);
  const int n = static_cast<int>(known.size());
  if (n == 0) return 1;
  // Scaled first: lengths and angles differ by orders of magnitude.
  Eigen::VectorXd scaled(n);
  Eigen::MatrixXd correlation(n, n);
  for (int a = 0; a < n; ++a) {
    scaled[a] = difference[known[a]] / std::sqrt(covariance(known[a], known[a]));
    for (int b = 0; b < n; ++b)
      correlation(a, b) = covariance(known[a], known[b]) /
                          std::sqrt(covariance(known[a], known[a]) * covariance(known[b], known[b]));
  }
  const double wald = scaled.dot(SymmetricSolver(correlation).Solve(scaled));
  return ChiSquaredTail(wald, n);
}

}  // namespace touchstone::diagnosis::engine
