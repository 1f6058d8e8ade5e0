#include "server/diagnosis/engine/competition/expected_evidence.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/base/numbers/distributions.h"
#include "server/base/status.h"
#include "server/diagnosis/engine/competition/rules.h"
#include "server/diagnosis/engine/fit/laplace_evidence.h"
#include "server/diagnosis/engine/fit/rules.h"
#include "server/diagnosis/engine/search/resemblance.h"
#include "server/diagnosis/engine/search/size_grid.h"

namespace touchstone::diagnosis::engine {
namespace {

std::vector<int> InOrder(int count) {
  std::vector<int> members(count);
  std::iota(members.begin(), members.end(), 0);
  return members;
}

}  // namespace

ExpectedEvidence::ExpectedEvidence(const StepwiseSearch& search, const Fit& given, double sigma)
    : search_(&search),
      experiment_(search.experiment()),
      given_(&given),
      own_(given.model.size()),
      sigma_(sigma) {
  experiment_.pool = nullptr;
}

absl::StatusOr<ExpectedEvidence> ExpectedEvidence::Create(const StepwiseSearch& search, const Fit& given,
                                                          int initial_effects, double sigma) {
  ExpectedEvidence expected(search, given, sigma);
  const int own = expected.own_;
  for (Extension& extension : search.ListExtensions(given, initial_effects))
    if (!extension.rare && extension.object.empty() && !extension.nameless && extension.start.size() > own)
      expected.extensions_.push_back(std::move(extension));
  Eigen::MatrixXd wide(given.columns.values.rows(), 0);
  for (const Extension& extension : expected.extensions_) {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const Eigen::MatrixXd columns,
        Derivatives(search.experiment(), extension.start, extension.start.Start(), given.predicted, own));
    expected.spans_.push_back({static_cast<int>(wide.cols()), static_cast<int>(columns.cols())});
    wide.conservativeResize(Eigen::NoChange, wide.cols() + columns.cols());
    wide.rightCols(columns.cols()) = columns;
  }
  std::vector<int> own_columns(own);
  std::iota(own_columns.begin(), own_columns.end(), 1);
  const Likelihood& likelihood = expected.likelihood();
  expected.all_ = Likelihood::Join(Likelihood::Pick(given.columns, own_columns), likelihood.Prepare(wide));
  expected.grams_ = Grams(likelihood, expected.all_);
  return expected;
}

// What noise alone adds to the residual's inner product under hypothesis s.
double ExpectedEvidence::NoiseSquares(int s) const {
  return sigma_ * sigma_ * (likelihood().rows() - likelihood().hypotheses()[s].effective_dof);
}

Eigen::VectorXd ExpectedEvidence::PointAt(const Extension& extension, int i, double size,
                                          bool together) const {
  Eigen::VectorXd point = extension.start.Start();
  for (int j = own_; j < extension.start.size(); ++j) {
    const FreeParameter& p = extension.start.parameters()[j];
    double sign = 1;
    const double reach = Reach(p, &sign);
    if (j == i) point[j] = p.neutral + sign * std::min(size, reach);
    if (j != i && together) point[j] = p.neutral + sign * std::min(p.scale, reach);
  }
  return point;
}

// The thresholds of SearchRules. Held-out rows: their squares fall by the likelihood ratio less what the fitted values cost on
// rows that they were not fitted to (those of one group in three or more, or of one part in five).
double ExpectedEvidence::RatioNeeded(int m, const ExpectedStep& step) const {
  const SearchRules& rules = search_->rules();
  const int values = extensions_[m].start.size() - own_;
  const double occam_nats = 0.5 * step.ratio - step.gain_nats;
  const double groups = static_cast<double>(experiment_.observations->groups().size());
  // A fitted value costs more on rows of parts that it was not fitted to.
  const double parts = groups >= 3 ? groups : kFitRules.folds.value();
  const double cost = parts / (parts - 1);
  const double kept = 1 - rules.min_relative_cv_gain;
  return std::max(
      {2 * (rules.enter_nats + occam_nats),
       ChiSquaredQuantile(1 - rules.family_wise_p / static_cast<double>(extensions_.size()), values),
       (1 - kept * kept) * likelihood().rows() + values * (1 + cost)});
}

double ExpectedEvidence::Power(int m, const ExpectedStep& step) const {
  return NoncentralChiSquaredTail(RatioNeeded(m, step), extensions_[m].start.size() - own_, step.ratio);
}

// Inner products where the effect stands where it acts, and leaves the noise.
std::vector<Eigen::MatrixXd> ExpectedEvidence::GramsWith(const Extension& extension,
                                                         const Eigen::MatrixXd& columns) const {
  const Likelihood::Columns prepared = likelihood().Prepare(columns),
                            own = Likelihood::Pick(all_, InOrder(own_));
  const int size = 1 + extension.start.size();
  std::vector<Eigen::MatrixXd> grams;
  for (int s = 0; s < static_cast<int>(grams_.size()); ++s) {
    Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(size, size);
    gram(0, 0) = NoiseSquares(s);
    gram.block(1, 1, own_, own_) = grams_[s].topLeftCorner(own_, own_);
    gram.bottomRightCorner(columns.cols(), columns.cols()) = likelihood().Gram(prepared, s);
    if (own_ > 0) {
      const Eigen::MatrixXd cross = likelihood().Cross(own, prepared, s);
      gram.block(1, 1 + own_, own_, columns.cols()) = cross;
      gram.block(1 + own_, 1, columns.cols(), own_) = cross.transpose();
    }
    grams.push_back(std::move(gram));
  }
  return grams;
}

absl::StatusOr<ExpectedStep> ExpectedEvidence::At(int m, int i, double size, bool together) const {
  const Extension& extension = extensions_[m];
  ExpectedStep step;
  step.point = PointAt(extension, i, size, together);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> predicted,
                              experiment_.observations->Predict(extension.start.At(step.point)));
  step.response = experiment_.observations->Change(given_->predicted, predicted);
  step.column = likelihood().Prepare(step.response);
  TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::MatrixXd columns,
                              Derivatives(experiment_, extension.start, step.point, predicted, own_));
  const LaplaceEvidence before = Without(step);
  const LaplaceEvidence with =
      ComputeLaplaceEvidence(likelihood(), GramsWith(extension, columns), InOrder(1 + extension.start.size()),
                             extension.start.parameters(), step.point);
  step.log_evidence = with.log_evidence;
  step.log_likelihood = with.log_likelihood;
  step.covariance = with.covariance;
  step.gain_nats = with.log_evidence - before.log_evidence;
  step.ratio = std::max(2 * (with.log_likelihood - before.log_likelihood), 0.0);
  return step;
}

// The inner products of a response with noise, the model's own columns and one extension's (-1: none), per hypothesis.
std::vector<Eigen::MatrixXd> ExpectedEvidence::GramsOf(const Likelihood::Columns& truth, int m) const {
  std::vector<int> members = InOrder(own_);
  if (m >= 0)
    for (int j = 0; j < spans_[m].count; ++j) members.push_back(own_ + spans_[m].first + j);
  const Likelihood::Columns some = Likelihood::Pick(all_, members);
  std::vector<Eigen::MatrixXd> grams;
  const int size = static_cast<int>(members.size());
  for (int s = 0; s < static_cast<int>(grams_.size()); ++s) {
    Eigen::MatrixXd gram(1 + size, 1 + size);
    gram(0, 0) = likelihood().Norms(truth, s)[0] + NoiseSquares(s);
    if (size > 0) {
      const Eigen::MatrixXd cross = likelihood().Cross(truth, some, s);
      gram.block(0, 1, 1, size) = cross;
      gram.block(1, 0, size, 1) = cross.transpose();
    }
    for (int a = 0; a < size; ++a)
      for (int b = 0; b < size; ++b) gram(1 + a, 1 + b) = grams_[s](members[a], members[b]);
    grams.push_back(std::move(gram));
  }
  return grams;
}

LaplaceEvidence ExpectedEvidence::Without(const ExpectedStep& step) const {
  return ComputeLaplaceEvidence(likelihood(), GramsOf(step.column, -1), InOrder(1 + own_),
                                given_->model.parameters(), given_->point);
}

LaplaceEvidence ExpectedEvidence::Linear(const ExpectedStep& step, int m) const {
  const Parameterization& start = extensions_[m].start;
  return ComputeLaplaceEvidence(likelihood(), GramsOf(step.column, m), InOrder(1 + start.size()),
                                start.parameters(), start.Start());
}

absl::StatusOr<ExpectedRival> ExpectedEvidence::Fitted(const ExpectedStep& step, int m) const {
  const Parameterization& start = extensions_[m].start;
  ExpectedRival rival{start.Start(), Linear(step, m)};
  for (int moves = 0; moves < kCompetitionRules.max_rival_steps; ++moves) {
    const Eigen::VectorXd point = start.Clip(rival.point + rival.evidence.step);
    const Eigen::VectorXd errors = rival.evidence.covariance.diagonal().cwiseMax(0).cwiseSqrt();
    const bool arrived =
        ((point - rival.point).cwiseAbs().array() <= kFitRules.small_step.value() * errors.array()).all();
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> predicted,
                                experiment_.observations->Predict(start.At(point)));
    TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::MatrixXd columns,
                                Derivatives(experiment_, start, point, predicted, 0));
    Eigen::MatrixXd values(step.response.size(), 1 + columns.cols());
    values << step.response - experiment_.observations->Change(given_->predicted, predicted), columns;
    std::vector<Eigen::MatrixXd> grams = Grams(likelihood(), likelihood().Prepare(values));
    for (int s = 0; s < static_cast<int>(grams.size()); ++s) grams[s](0, 0) += NoiseSquares(s);
    rival.point = point;
    rival.evidence =
        ComputeLaplaceEvidence(likelihood(), grams, InOrder(1 + start.size()), start.parameters(), point);
    if (arrived) break;
  }
  return rival;
}

double ExpectedEvidence::ShareExplainedBy(int m, const ExpectedStep& step) const {
  Eigen::MatrixXd columns(step.response.size(), own_ + spans_[m].count);
  columns << all_.values.leftCols(own_), all_.values.middleCols(own_ + spans_[m].first, spans_[m].count);
  return ShareExplained(columns, step.response);
}

}  // namespace touchstone::diagnosis::engine
