#include "server/diagnosis/selection/curves/session_slots.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/base/numbers/decompositions.h"
#include "server/base/units.h"
#include "server/diagnosis/engine/fit/laplace_evidence.h"

namespace touchstone::diagnosis::selection {

SessionSlots::SessionSlots(const engine::Experiment& experiment,
                           const touches::TouchObservationModel& touches, const engine::Fit& fit,
                           const touches::Prediction& details, const CurveCovariate& covariate)
    : likelihood_(*experiment.likelihood),
      touches_(touches),
      o_(touches.observations()),
      fit_(fit),
      details_(details),
      covariate_(covariate) {
  for (const int k : touches_.contrasts().touches())
    if (std::isfinite(covariate_.value(k, 0))) order_.push_back(k);
  std::sort(order_.begin(), order_.end());
  std::stable_sort(order_.begin(), order_.end(),
                   [&](int a, int b) { return covariate_.value(a, 0) < covariate_.value(b, 0); });
  hypotheses_ = {0};
  if (fit_.hypothesis != 0) hypotheses_.push_back(fit_.hypothesis);
}

bool SessionSlots::InSessionOrder() const {
  return std::is_sorted(order_.begin(), order_.end());
}

void SessionSlots::Divide(std::vector<int> begins) {
  begins_ = std::move(begins);
  begins_.push_back(touches());
  const int f = columns();
  basis_ = Eigen::MatrixXd::Zero(touches_.rows(), slots() * f);
  std::vector<double> per_finger(o_.time_s.size());
  for (int slot = 0; slot < slots(); ++slot)
    for (int c = 0; c < f; ++c) {
      std::fill(per_finger.begin(), per_finger.end(), 0);
      for (int place = begins_[slot]; place < begins_[slot + 1]; ++place) {
        const size_t e = static_cast<size_t>(order_[place]) * o_.fingers + c + 1;
        const double slope = kMetresPerMillimetre * details_.inverse_speed_s_per_m[e];
        per_finger[e] = std::isfinite(slope) ? slope : 0;
      }
      basis_.col(slot * f + c) = touches_.contrasts().Apply(per_finger);
    }
  const engine::Likelihood::Columns all = engine::Likelihood::Join(fit_.columns, likelihood_.Prepare(basis_));
  forms_.clear();
  std::vector<double> base;
  for (const int s : hypotheses_) {
    forms_.push_back(MakeForm(likelihood_.Gram(all, s), s));
    base.push_back(LogLikelihood(static_cast<int>(forms_.size()) - 1, 0));
  }
  base_log_ = engine::LogSum(base);
}

double SessionSlots::LogLikelihood(int hypothesis, double drop) const {
  const Form& form = forms_[hypothesis];
  return likelihood_.LogPrior(form.s) + likelihood_.LogLikelihood(form.q - drop, form.s);
}

SessionSlots::Form SessionSlots::MakeForm(const Eigen::MatrixXd& gram, int s) const {
  const int p = fit_.model.size(), m = static_cast<int>(gram.cols()) - 1 - p;
  Form form;
  form.s = s;
  form.q = gram(0, 0);
  form.a = gram.bottomRightCorner(m, m);
  form.b = gram.col(0).tail(m);
  form.plain = form.a.diagonal();
  if (p > 0) {
    Eigen::MatrixXd jj = gram.block(1, 1, p, p);
    for (int i = 0; i < p; ++i) jj(i, i) *= 1 + 1e-9, jj(i, i) += 1e-300;
    const SymmetricSolver solver(jj);
    const Eigen::VectorXd own = solver.SolveColumns(gram.block(1, 0, p, 1));
    const Eigen::MatrixXd cross = gram.block(1, 1 + p, p, m);
    form.q -= gram.block(1, 0, p, 1).col(0).dot(own);
    form.a -= cross.transpose() * solver.SolveColumns(cross);
    form.b -= cross.transpose() * own;
  }
  AddSums(&form);
  return form;
}

void SessionSlots::AddSums(Form* form) const {
  const int f = columns(), n = slots();
  form->b_before = Eigen::MatrixXd::Zero(f, n + 1);
  form->plain_before = Eigen::VectorXd::Zero(n + 1);
  form->a_before = Eigen::MatrixXd::Zero((n + 1) * f, (n + 1) * f);
  Eigen::MatrixXd& sums = form->a_before;
  for (int i = 0; i < n; ++i) {
    form->b_before.col(i + 1) = form->b_before.col(i) + form->b.segment(i * f, f);
    form->plain_before[i + 1] = form->plain_before[i] + form->plain.segment(i * f, f).sum();
    for (int j = 0; j < n; ++j)
      sums.block((i + 1) * f, (j + 1) * f, f, f) =
          sums.block(i * f, (j + 1) * f, f, f) + sums.block((i + 1) * f, j * f, f, f) -
          sums.block(i * f, j * f, f, f) + form->a.block(i * f, j * f, f, f);
  }
}

SessionSlots::Products SessionSlots::OfSlots(int hypothesis, int begin, int end) const {
  const Form& form = forms_[hypothesis];
  const int f = columns();
  const auto sum = [&](int i, int j) { return form.a_before.block(i * f, j * f, f, f); };
  return {sum(end, end) - sum(begin, end) - sum(end, begin) + sum(begin, begin),
          form.b_before.col(end) - form.b_before.col(begin),
          form.plain_before[end] - form.plain_before[begin]};
}

SessionSlots::Products SessionSlots::OfWeights(int hypothesis, const Eigen::VectorXd& weights) const {
  const Form& form = forms_[hypothesis];
  const int f = columns();
  Eigen::MatrixXd mixed = Eigen::MatrixXd::Zero(slots() * f, f);
  for (int slot = 0; slot < slots(); ++slot)
    mixed.middleRows(slot * f, f).diagonal().setConstant(weights[slot]);
  return {mixed.transpose() * (form.a * mixed), mixed.transpose() * form.b,
          mixed.rowwise().squaredNorm().dot(form.plain)};
}

Eigen::MatrixXd SessionSlots::Columns(const Eigen::VectorXd& weights) const {
  const int f = columns();
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(basis_.rows(), f);
  for (int slot = 0; slot < slots(); ++slot) sum += weights[slot] * basis_.middleCols(slot * f, f);
  return sum;
}

}  // namespace touchstone::diagnosis::selection
