#include "server/diagnosis/design/propose.h"

#include <absl/strings/str_cat.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/base/status.h"
#include "server/diagnosis/design/touch_candidates.h"
#include "server/diagnosis/inference/free_model.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone {
namespace {

constexpr int kMaxData = 3000;           // touches that stand for the present data
constexpr int kRunLength = 50;           // in runs, so that a press still reaches the next touch
constexpr double kStep = 0.02;           // of a coordinate's scale, for derivatives
constexpr double kNothing = 0.5;         // squared sigmas in all, below which no touch tells anything
constexpr double kMaxADerivative = 200;  // sigmas a step; more is a finger that slips off a face

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

// Times of touch k less their mean, in sigmas.
Vector Projected(const std::vector<double>& time_s, int k, int fingers, double sigma_s) {
  Vector t = Eigen::Map<const Vector>(&time_s[size_t(k) * fingers], fingers);
  return (t.array() - t.mean()).matrix() / sigma_s;
}

// What one explanation says about the present data and the candidates, and how it could change its mind.
struct Explanation {
  std::vector<Vector> said;     // a candidate: predicted times
  std::vector<Matrix> columns;  // a candidate: derivatives by the coordinates
  Matrix covariance;            // of the coordinates, from the present data and their priors
};

// Derivatives of all coordinates at every touch, [touch] fingers x coordinates; not finite ones are 0.
absl::StatusOr<std::vector<Matrix>> Derivatives(const Observations& observations, const FreeModel& free,
                                                const std::vector<double>& at_start, double sigma_s,
                                                ThreadPool* pool) {
  const int fingers = observations.fingers;
  std::vector<Matrix> columns(observations.size(), Matrix::Zero(fingers, free.size()));
  const Vector start = free.Start();
  for (int c = 0; c < free.size(); ++c) {
    const Coordinate& coordinate = free.coordinates()[c];
    double step = kStep * coordinate.scale;
    if (start[c] + step > coordinate.upper) step = -step;
    Vector point = start;
    point[c] += step;
    TOUCHSTONE_ASSIGN_OR_RETURN(const Prediction moved,
                                Predict(observations, free.At(point), false, false, pool));
    for (int k = 0; k < observations.size(); ++k) {
      const Vector change =
          Projected(moved.time_s, k, fingers, sigma_s) - Projected(at_start, k, fingers, sigma_s);
      if (change.allFinite() && change.cwiseAbs().maxCoeff() < kMaxADerivative)
        columns[k].col(c) = change * (coordinate.scale / step);
    }
  }
  return columns;
}

// `weight`: how many touches of the data one of `data` stands for.
absl::StatusOr<Explanation> Explain(const Model& model, const Observations& data, double weight,
                                    const Observations& candidates, double sigma_s, ThreadPool* pool) {
  FreeModel free(model, data.objects);
  for (size_t e = 0; e < model.effects.size(); ++e) free.Free(static_cast<int>(e), true);
  Explanation result;
  TOUCHSTONE_ASSIGN_OR_RETURN(const Prediction present, Predict(data, model, false, false, pool));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<Matrix> known,
                              Derivatives(data, free, present.time_s, sigma_s, pool));
  // In units of its scale every coordinate has a prior of width 1.
  Matrix information = Matrix::Identity(free.size(), free.size());
  for (int k = 0; k < data.size(); ++k)
    if (data.used[k]) information += weight * known[k].transpose() * known[k];
  result.covariance = information.llt().solve(Matrix::Identity(free.size(), free.size()));

  TOUCHSTONE_ASSIGN_OR_RETURN(const Prediction future, Predict(candidates, model, false, false, pool));
  TOUCHSTONE_ASSIGN_OR_RETURN(result.columns, Derivatives(candidates, free, future.time_s, sigma_s, pool));
  for (int k = 0; k < candidates.size(); ++k)
    result.said.push_back(Projected(future.time_s, k, candidates.fingers, sigma_s));
  return result;
}

// One explanation that is fitted again and again to what another one would have measured.
class Follower {
 public:
  Follower(const Explanation* self, const Explanation* other)
      : self_(self), other_(other), covariance_(self->covariance), moved_(Vector::Zero(covariance_.rows())) {}

  // How much worse than the other the best fit becomes with touch k, in squared sigmas; exact for what is
  // linear (recursive least squares).
  double Gain(int k) const {
    const Matrix& g = self_->columns[k];
    const Vector surprise = other_->said[k] - self_->said[k] - g * moved_;
    if (!surprise.allFinite()) return 0;
    return surprise.dot(Spread(g).llt().solve(surprise));
  }
  // How much is learnt about the own values: log det, nats.
  double Learning(int k) const { return std::log(Spread(self_->columns[k]).llt().matrixL().determinant()); }
  // What the own values leave open about touch k, sigmas.
  double Open(int k) const {
    return std::sqrt(std::max(0.0, Spread(self_->columns[k]).trace() - self_->columns[k].rows()));
  }
  void Take(int k) {
    separation_ += Gain(k);
    const Matrix& g = self_->columns[k];
    const Vector surprise = other_->said[k] - self_->said[k] - g * moved_;
    const Matrix gain =
        covariance_ * g.transpose() * Spread(g).llt().solve(Matrix::Identity(g.rows(), g.rows()));
    moved_ += gain * surprise;
    covariance_ -= gain * g * covariance_;
    covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
  }
  double separation() const { return separation_; }

 private:
  Matrix Spread(const Matrix& g) const {
    return Matrix::Identity(g.rows(), g.rows()) + g * covariance_ * g.transpose();
  }

  const Explanation* self_;
  const Explanation* other_;
  Matrix covariance_;
  Vector moved_;  // the own values, since the start
  double separation_ = 0;
};

// The best explanation against one rival: either may be true, and the other follows.
struct Pair {
  Follower rival, best;
  double separation() const { return 0.5 * (rival.separation() + best.separation()); }
  double Gain(int k) const { return 0.5 * (rival.Gain(k) + best.Gain(k)); }
};

v1::ProposedTouch Describe(const Observations& candidates, int k, const std::string& purpose,
                           double separation) {
  const MeasurementSet& set = *candidates.set;
  const int row = candidates.row[k];
  v1::ProposedTouch proposed;
  proposed.set_object(candidates.objects[candidates.object[k]]);
  proposed.set_purpose(purpose);
  proposed.set_separation(separation);
  const auto fill = [](const Eigen::Vector3d& from, v1::Vector3* to) {
    to->set_x(from.x());
    to->set_y(from.y());
    to->set_z(from.z());
  };
  v1::CommandedTouch* touch = proposed.mutable_touch();
  fill(set.target_m[row], touch->mutable_target_m());
  fill(set.approach[row], touch->mutable_approach());
  fill(set.lateral[row], touch->mutable_lateral());
  touch->set_standoff_m(set.standoff_m[row]);
  touch->set_speed_m_s(set.speed_m_s[row]);
  if (set.has_session_time) touch->set_session_time_s(set.session_time_s[row]);
  for (const auto& [name, values] : set.covariates) (*touch->mutable_covariates())[name] = values[row];
  return proposed;
}

bool Drifts(const Model& model) {
  for (const EffectInstance& instance : model.effects) {
    const Effect& effect = *instance.effect;
    if (effect.name == "thermal_drift") return true;
    if (effect.formula && effect.formula->expression.find("session_time_s") != std::string::npos) return true;
  }
  return false;
}

}  // namespace

absl::StatusOr<std::vector<v1::ProposedTouch>> ProposeTouches(
    const Observations& observations, const std::vector<std::shared_ptr<const Model>>& rivals,
    const std::vector<std::string>& names, double sigma_s, int touches, uint64_t seed, ThreadPool* pool) {
  if (rivals.empty() || rivals.size() != names.size())
    return absl::InvalidArgumentError(absl::StrCat("to propose touches takes one name for every model, got ",
                                                   rivals.size(), " models and ", names.size(), " names"));
  std::vector<v1::ProposedTouch> proposed;
  if (!(sigma_s > 0) || touches <= 0 || observations.size() == 0) return proposed;

  // The present data, or runs of them.
  std::vector<int> keep;
  const int runs = (observations.size() + kRunLength - 1) / kRunLength;
  const int run_step = std::max(1, (observations.size() + kMaxData - 1) / kMaxData);
  for (int run = 0; run < runs; run += run_step)
    for (int k = run * kRunLength; k < std::min(observations.size(), (run + 1) * kRunLength); ++k)
      keep.push_back(k);
  const Observations data = PartOf(observations, keep);

  CandidateChoice choice;
  choice.seed = seed;
  for (const auto& rival : rivals) choice.different_times |= Drifts(*rival);
  TOUCHSTONE_ASSIGN_OR_RETURN(const Observations candidates,
                              MakeCandidates(observations, *rivals[0], choice, pool));
  if (candidates.size() == 0) return proposed;

  std::vector<Explanation> explanations;
  for (const auto& rival : rivals) {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        Explanation explanation,
        Explain(*rival, data, double(observations.size()) / data.size(), candidates, sigma_s, pool));
    explanations.push_back(std::move(explanation));
  }
  const bool alone = rivals.size() == 1;
  std::vector<Pair> pairs;
  for (size_t j = alone ? 0 : 1; j < rivals.size(); ++j)
    pairs.push_back(
        {Follower(&explanations[j], &explanations[0]), Follower(&explanations[0], &explanations[j])});

  // One after the other, spread over the objects.
  const int objects = static_cast<int>(observations.objects.size());
  const int max_an_object = std::max(1, (3 * touches / 2 + objects - 1) / objects);
  std::vector<int> of_object(objects, 0);
  std::vector<char> taken(candidates.size(), 0);
  for (int n = 0; n < touches; ++n) {
    int best = -1;
    double best_worth = 0;
    for (int k = 0; k < candidates.size(); ++k) {
      if (taken[k] || of_object[candidates.object[k]] >= max_an_object) continue;
      if (!explanations[0].said[k].allFinite()) continue;
      double worth = 0;
      // A rival that is as good as told apart counts less and less.
      for (const Pair& pair : pairs)
        worth += alone ? pair.best.Learning(k) : std::log1p(pair.Gain(k) / (1 + pair.separation()));
      if (worth > best_worth) best = k, best_worth = worth;
    }
    if (best < 0) break;
    size_t max_told = 0;
    double most = -1;
    for (size_t j = 0; j < pairs.size(); ++j) {
      const double told = pairs[j].Gain(best) / (1 + pairs[j].separation());
      if (told > most) most = told, max_told = j;
    }
    proposed.push_back(Describe(candidates, best,
                                alone ? absl::StrCat("learns the values of ", names[0])
                                      : absl::StrCat("tells ", names[0], " from ", names[max_told + 1]),
                                alone ? pairs[0].best.Open(best) : std::sqrt(pairs[max_told].Gain(best))));
    for (Pair& pair : pairs) pair.rival.Take(best), pair.best.Take(best);
    taken[best] = 1;
    ++of_object[candidates.object[best]];
  }
  double separation = 0;
  for (const Pair& pair : pairs) separation = std::max(separation, pair.separation());
  if (!alone && separation < kNothing) proposed.clear();
  return proposed;
}

}  // namespace touchstone
