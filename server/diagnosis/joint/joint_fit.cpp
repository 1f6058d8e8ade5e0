#include "server/diagnosis/joint/joint_fit.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/base/status.h"
#include "server/diagnosis/engine/fit/rules.h"
#include "server/diagnosis/joint/rules.h"

namespace touchstone::diagnosis::joint {
namespace {

using engine::Likelihood;

// One kind at some point: what its rows say there.
struct State {
  Eigen::VectorXd point;
  std::vector<double> predicted;
  Likelihood::Columns columns;  // residual, derivatives
};

class JointGaussNewton {
 public:
  JointGaussNewton(const std::vector<Part>& parts, const HasOwnValue& has_own, JointFit* fit)
      : parts_(parts), kinds_(static_cast<int>(parts.size())), fit_(*fit), hypothesis_(parts.size(), 0) {
    fit_.fits.resize(kinds_), fit_.place.resize(kinds_), fit_.alone.resize(kinds_), states_.resize(kinds_);
    for (int kind = 0; kind < kinds_; ++kind) {
      for (int j = 0; j < parts[kind].start.size(); ++j) {
        int place = has_own && has_own(parts[kind].start, j) ? -1 : PlaceOf(kind, j);
        if (place < 0) {
          place = static_cast<int>(fit_.parameters.size());
          fit_.parameters.push_back(parts[kind].start.parameters()[j]);
        }
        fit_.place[kind].push_back(place);
      }
      rows_ += parts[kind].experiment->likelihood->rows();
    }
    // Noise of one: each kind's inner products come in units of its own.
    unit_ = std::make_unique<Likelihood>(std::vector<int>{0, rows_}, nullptr, 0, nullptr);
    unit_->SetLeastNoise(1);
  }

  absl::Status Run() {
    Eigen::VectorXd point(static_cast<int>(fit_.parameters.size()));
    for (int kind = kinds_ - 1; kind >= 0; --kind) {  // where several have a start, that of the first
      const Eigen::VectorXd start = parts_[kind].start.Clip(parts_[kind].start.Start());
      for (int i = 0; i < start.size(); ++i) point[fit_.place[kind][i]] = start[i];
    }
    TOUCHSTONE_RETURN_IF_ERROR(Predict(point, &states_));
    for (int kind = 0; kind < kinds_; ++kind) TOUCHSTONE_RETURN_IF_ERROR(Linearise(kind));
    for (int kind = 0; kind < kinds_; ++kind) hypothesis_[kind] = Alone(kind).hypothesis;
    for (int iteration = 0; iteration < kJointRules.max_iterations && point.size() > 0; ++iteration) {
      if (iteration > 0)
        for (int kind = 0; kind < kinds_; ++kind) TOUCHSTONE_RETURN_IF_ERROR(Linearise(kind));
      const double here = Objective(states_, point);
      const Eigen::VectorXd step = Step(point).step;
      double gain = 0;
      Eigen::VectorXd moved;
      for (int halving = 0; halving <= kJointRules.max_halvings; ++halving) {
        moved = Clip(point + std::ldexp(1.0, -halving) * step);
        std::vector<State> states(kinds_);
        TOUCHSTONE_RETURN_IF_ERROR(Predict(moved, &states));
        gain = Objective(states, moved) - here;
        if (!(gain > 0)) continue;
        for (int kind = 0; kind < kinds_; ++kind) {
          states[kind].columns = Likelihood::Join(
              states[kind].columns, Likelihood::Pick(states_[kind].columns, DerivativesOf(kind)));
        }
        states_ = std::move(states);
        point = moved;
        break;
      }
      if (!(gain > engine::kFitRules.converged)) break;
    }
    return Finish(point);
  }

 private:
  // Among the joint values so far, that of an earlier kind which parameter j of this one is; -1: none.
  int PlaceOf(int kind, int j) const {
    for (int earlier = 0; earlier < kind; ++earlier)
      for (int i = 0; i < parts_[earlier].start.size(); ++i)
        if (IsSameValue(parts_[earlier].start, i, parts_[kind].start, j)) return fit_.place[earlier][i];
    return -1;
  }
  std::vector<int> DerivativesOf(int kind) const {
    std::vector<int> columns(parts_[kind].start.size());
    std::iota(columns.begin(), columns.end(), 1);
    return columns;
  }
  Eigen::VectorXd Own(int kind, const Eigen::VectorXd& point) const {
    Eigen::VectorXd own(parts_[kind].start.size());
    for (int i = 0; i < own.size(); ++i) own[i] = point[fit_.place[kind][i]];
    return own;
  }
  Eigen::VectorXd Clip(Eigen::VectorXd point) const {
    for (int i = 0; i < point.size(); ++i)
      point[i] = std::clamp(point[i], fit_.parameters[i].lower, fit_.parameters[i].upper);
    return point;
  }

  absl::Status Predict(const Eigen::VectorXd& point, std::vector<State>* states) const {
    for (int kind = 0; kind < kinds_; ++kind) {
      State& state = (*states)[kind];
      const engine::Experiment& experiment = *parts_[kind].experiment;
      state.point = Own(kind, point);
      TOUCHSTONE_ASSIGN_OR_RETURN(state.predicted,
                                  experiment.observations->Predict(parts_[kind].start.At(state.point)));
      state.columns = experiment.likelihood->Prepare(experiment.observations->Residual(state.predicted));
    }
    return absl::OkStatus();
  }

  absl::Status Linearise(int kind) {
    State& state = states_[kind];
    const engine::Experiment& experiment = *parts_[kind].experiment;
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const Eigen::MatrixXd derivatives,
        engine::Derivatives(experiment, parts_[kind].start, state.point, state.predicted, 0));
    Eigen::MatrixXd values(experiment.likelihood->rows(), derivatives.cols() + 1);
    values << experiment.observations->Residual(state.predicted), derivatives;
    state.columns = experiment.likelihood->Prepare(values);
    return absl::OkStatus();
  }

  Eigen::MatrixXd Gram(int kind) const {
    return parts_[kind].experiment->likelihood->Gram(states_[kind].columns, hypothesis_[kind]);
  }

  // What this kind alone says, from where it stands.
  engine::LaplaceEvidence Alone(int kind) const {
    const Likelihood& likelihood = *parts_[kind].experiment->likelihood;
    std::vector<int> members(parts_[kind].start.size() + 1);
    std::iota(members.begin(), members.end(), 0);
    return engine::ComputeLaplaceEvidence(likelihood, engine::Grams(likelihood, states_[kind].columns),
                                          members, parts_[kind].start.parameters(), states_[kind].point);
  }

  double Objective(const std::vector<State>& states, const Eigen::VectorXd& point) const {
    double sum = engine::LogPriorOfValues(fit_.parameters, point);
    for (int kind = 0; kind < kinds_; ++kind) {
      const Likelihood& likelihood = *parts_[kind].experiment->likelihood;
      const Likelihood::Columns residual = Likelihood::Pick(states[kind].columns, {0});
      sum += likelihood.LogLikelihood(likelihood.Gram(residual, hypothesis_[kind])(0, 0), hypothesis_[kind]) /
             parts_[kind].variance_factor;
    }
    return sum;
  }

  // The step of all together. The noise of each kind is what the step leaves of it.
  engine::LaplaceEvidence Step(const Eigen::VectorXd& point) const {
    const int size = static_cast<int>(point.size());
    std::vector<Eigen::MatrixXd> grams;
    std::vector<double> q;
    for (int kind = 0; kind < kinds_; ++kind) {
      grams.push_back(Gram(kind));
      q.push_back(grams.back()(0, 0));
    }
    std::vector<int> members(size + 1);
    std::iota(members.begin(), members.end(), 0);
    engine::LaplaceEvidence found;
    for (int pass = 0; pass < kJointRules.noise_passes; ++pass) {
      Eigen::MatrixXd joint = Eigen::MatrixXd::Zero(size + 1, size + 1);
      for (int kind = 0; kind < kinds_; ++kind) {
        const double sigma = parts_[kind].experiment->likelihood->Sigma(q[kind], 0);
        const double weight = 1 / (sigma * sigma * parts_[kind].variance_factor);
        const int own = parts_[kind].start.size();
        for (int a = 0; a <= own; ++a)
          for (int b = 0; b <= own; ++b)
            joint(a == 0 ? 0 : 1 + fit_.place[kind][a - 1], b == 0 ? 0 : 1 + fit_.place[kind][b - 1]) +=
                weight * grams[kind](a, b);
      }
      found = engine::ComputeLaplaceEvidence(*unit_, {joint}, members, fit_.parameters, point);
      for (int kind = 0; kind < kinds_; ++kind) {
        Eigen::VectorXd along(parts_[kind].start.size() + 1);
        along[0] = 1;
        for (int i = 1; i < along.size(); ++i) along[i] = -found.step[fit_.place[kind][i - 1]];
        q[kind] = std::max(along.dot(grams[kind] * along), 0.0);
      }
    }
    return found;
  }

  absl::Status Finish(const Eigen::VectorXd& point) {
    for (int kind = 0; kind < kinds_; ++kind) TOUCHSTONE_RETURN_IF_ERROR(Linearise(kind));
    fit_.point = point;
    const engine::LaplaceEvidence all = Step(point);
    fit_.covariance = all.covariance;
    fit_.log_evidence = all.log_evidence - all.log_likelihood;  // the prior of the values, and Occam's factor
    for (int kind = 0; kind < kinds_; ++kind) {
      const Likelihood& likelihood = *parts_[kind].experiment->likelihood;
      const Likelihood::Columns residual = Likelihood::Pick(states_[kind].columns, {0});
      std::vector<double> logs;
      for (int s = 0; s < static_cast<int>(likelihood.hypotheses().size()); ++s)
        logs.push_back(likelihood.LogPrior(s) +
                       likelihood.LogLikelihood(likelihood.Gram(residual, s)(0, 0), s));
      const double averaged = engine::LogSum(logs) / parts_[kind].variance_factor;
      fit_.log_likelihood += averaged;
      fit_.log_evidence += averaged;

      const engine::LaplaceEvidence alone = Alone(kind);
      engine::Fit& fit = fit_.fits[kind];
      fit.model = parts_[kind].start;
      fit.model.MoveTo(states_[kind].point);
      fit.point = states_[kind].point;
      fit.columns = states_[kind].columns;
      fit.predicted = states_[kind].predicted;
      fit.log_likelihood = averaged;
      fit.log_evidence = alone.log_evidence;
      fit.hypothesis = hypothesis_[kind];
      fit.sigma = alone.sigma;
      fit.covariance = parts_[kind].variance_factor * alone.covariance;
      fit_.alone[kind] = fit.point + alone.step;
    }
    return absl::OkStatus();
  }

  const std::vector<Part>& parts_;
  const int kinds_;
  JointFit& fit_;
  std::unique_ptr<Likelihood> unit_;
  int rows_ = 0;
  std::vector<State> states_;
  std::vector<int> hypothesis_;
};

}  // namespace

Eigen::MatrixXd JointFit::CovarianceOf(int kind) const {
  const std::vector<int>& places = place[kind];
  const int size = static_cast<int>(places.size());
  Eigen::MatrixXd part(size, size);
  for (int a = 0; a < size; ++a)
    for (int b = 0; b < size; ++b) part(a, b) = covariance(places[a], places[b]);
  return part;
}

bool IsSameValue(const engine::Parameterization& a, int i, const engine::Parameterization& b, int j) {
  const engine::FreeParameter &one = a.parameters()[i], &other = b.parameters()[j];
  const model::Effect& effect = *a.base().effects[one.effect].effect;
  return effect.name == b.base().effects[other.effect].effect->name && one.parameter == other.parameter &&
         one.object == other.object && one.weights == other.weights;
}

absl::StatusOr<JointFit> FitJointly(const std::vector<Part>& parts, const HasOwnValue& has_own) {
  JointFit fit;
  TOUCHSTONE_RETURN_IF_ERROR(JointGaussNewton(parts, has_own, &fit).Run());
  return fit;
}

}  // namespace touchstone::diagnosis::joint
