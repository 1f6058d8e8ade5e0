#include "server/diagnosis/joint/compared_values.h"

#include <algorithm>
#include <cmath>

#include "server/base/numbers/normal.h"
#include "server/diagnosis/joint/between_sessions.h"
#include "server/diagnosis/joint/rules.h"

namespace touchstone::diagnosis::joint {
namespace {

// How far each entry of a description moves with each of the session's values; the entries' unit over SI.
Eigen::MatrixXd GradientsOf(const engine::Parameterization& model, int effect, const Eigen::VectorXd& point) {
  const std::vector<engine::ParameterEstimate> at = model.Describe(effect, point, {});
  Eigen::MatrixXd gradients = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(at.size()), model.size());
  for (int i = 0; i < model.size(); ++i) {
    const engine::FreeParameter& parameter = model.parameters()[i];
    if (parameter.effect != effect) continue;
    double step = kJointRules.gradient_step * parameter.scale;
    if (point[i] + step > parameter.upper) step = -step;
    Eigen::VectorXd moved = point;
    moved[i] += step;
    const std::vector<engine::ParameterEstimate> there = model.Describe(effect, moved, {});
    for (size_t e = 0; e < at.size(); ++e)
      gradients(static_cast<Eigen::Index>(e), i) = (there[e].value - at[e].value) / step;
  }
  return gradients;
}

// One effect of one session, described.
struct DescribedSession {
  int session = 0;
  std::vector<engine::ParameterEstimate> entries;  // of the group
  Eigen::MatrixXd gradients;                       // entries x the session's values
  std::vector<double> moves;                       // the rows, over the noise, by one unit of each entry
};

class GroupDescriber {
 public:
  GroupDescriber(const SessionEvidence& evidence, const SessionChoice& choice)
      : evidence_(evidence), choice_(choice) {}

  ComparedEffect Compared(int g) const {
    ComparedEffect compared;
    compared.effect = group(g).effect;
    compared.object = group(g).object;
    compared.given = group(g).given;
    compared.values = state(g);
    const SharedEvidence one = evidence_.Of(WithState(choice_.states(), g, SessionValues::kShared));
    const SharedEvidence apart = evidence_.Of(WithState(choice_.states(), g, SessionValues::kOwn));
    if (choice_.IsCompared(g)) {
      compared.p = choice_.PApart(one, apart);
      compared.gain_nats = apart.log_evidence - one.log_evidence;
    }
    if (state(g) == SessionValues::kOwn) compared.equivalent = choice_.EquivalentChanges(g);
    DescribeEntries(g, apart, &compared);
    return compared;
  }

 private:
  const ValueGroup& group(int index) const { return evidence_.groups()[index]; }
  SessionValues state(int index) const { return choice_.state(index); }

  DescribedSession Described(int g, int session, const SharedEvidence& apart) const {
    const engine::Parameterization& model = evidence_.fit(session).model;
    const int effect = IndexOf(model.base(), group(g).effect);
    const Eigen::VectorXd point = evidence_.PointOf(apart, session);
    const std::vector<engine::ParameterEstimate> all =
        model.Describe(effect, point, evidence_.CovarianceOf(apart, session, session));
    const Eigen::MatrixXd gradients = GradientsOf(model, effect, point);
    DescribedSession described;
    described.session = session;
    described.gradients.resize(0, model.size());
    for (size_t e = 0; e < all.size(); ++e) {
      if (all[e].object != group(g).object) continue;
      described.entries.push_back(all[e]);
      described.gradients.conservativeResize(described.gradients.rows() + 1, Eigen::NoChange);
      const Eigen::RowVectorXd gradient = gradients.row(static_cast<Eigen::Index>(e));
      described.gradients.bottomRows(1) = gradient;
      double moves = 0;
      for (int i = 0; i < model.size(); ++i)
        if (gradient[i] != 0)
          moves += std::pow(gradient[i] / gradient.squaredNorm() * evidence_.MovesRows(session, i), 2);
      described.moves.push_back(std::sqrt(moves));
    }
    return described;
  }

  void DescribeEntries(int g, const SharedEvidence& apart, ComparedEffect* compared) const {
    std::vector<DescribedSession> sessions;
    for (const int session : group(g).sessions) sessions.push_back(Described(g, session, apart));
    double most = 0;
    std::vector<double> errors;
    for (size_t e = 0; e < sessions[0].entries.size(); ++e) {
      ComparedValue value;
      value.by_session.resize(evidence_.sessions());
      for (const DescribedSession& described : sessions)
        value.by_session[described.session] = described.entries[e];
      double farthest = -1;
      for (size_t b = 1; b < sessions.size(); ++b)
        for (size_t a = 0; a < b; ++a) CompareTwo(sessions[a], sessions[b], e, apart, &farthest, &value);
      errors.push_back(std::max(farthest, 0.0));
      most = std::max(most, errors.back());
      compared->entries.push_back(std::move(value));
    }
    for (size_t e = 0; e < compared->entries.size(); ++e) {
      ComparedValue& value = compared->entries[e];
      const bool apart =
          state(g) == SessionValues::kOwn && (errors[e] == most || errors[e] >= kJointRules.changed_errors);
      SetVerdict(apart, choice_.IsCompared(g) && value.std_error > 0 && Unmoved(sessions, e, value), &value);
    }
  }

  // Sets the difference of two sessions where it is farther from zero than those so far.
  void CompareTwo(const DescribedSession& from, const DescribedSession& to, size_t entry,
                  const SharedEvidence& apart, double* farthest, ComparedValue* value) const {
    const auto e = static_cast<Eigen::Index>(entry);
    const auto covariance = [&](const DescribedSession& one, const DescribedSession& other) {
      return one.gradients.row(e).dot(evidence_.CovarianceOf(apart, one.session, other.session) *
                                      other.gradients.row(e).transpose());
    };
    const double variance = covariance(from, from) + covariance(to, to) - 2 * covariance(from, to);
    const double difference = to.entries[entry].value - from.entries[entry].value;
    const double std_error = std::sqrt(std::max(variance, 0.0));
    const double errors = std_error > 0 ? std::abs(difference) / std_error : 0;
    if (errors <= *farthest) return;
    *farthest = errors;
    value->from = from.session, value->to = to.session;
    value->difference = difference, value->std_error = std_error;
    value->lower = difference - kNormalQuantile975 * std_error;
    value->upper = difference + kNormalQuantile975 * std_error;
  }

  // Whether no difference in the interval would move rows by more than their noise.
  static bool Unmoved(const std::vector<DescribedSession>& sessions, size_t entry,
                      const ComparedValue& value) {
    double moves = 0;
    for (const DescribedSession& described : sessions) moves = std::max(moves, described.moves[entry]);
    return moves * std::max(std::abs(value.lower), std::abs(value.upper)) <= 1;
  }

  const SessionEvidence& evidence_;
  const SessionChoice& choice_;
};

// A session at a bound, without a standard error, is in a run of its own unless its value is that of the one before.
std::vector<SessionRun> RunsOf(const ComparedValue& value) {
  std::vector<SessionRun> runs;
  for (size_t session = 0; session < value.by_session.size(); ++session) {
    if (!value.by_session[session]) continue;
    const SessionEstimate own = {value.by_session[session]->value, value.by_session[session]->std_error};
    if (!runs.empty()) {
      SessionEstimate& mean = runs.back().mean;
      if (std::abs(own.value - mean.value) <=
          kJointRules.run_errors * std::hypot(own.std_error, mean.std_error)) {
        runs.back().sessions.push_back(static_cast<int>(session));
        if (!(own.std_error > 0 && mean.std_error > 0)) continue;
        const double weight = 1 / (own.std_error * own.std_error);
        const double before = 1 / (mean.std_error * mean.std_error);
        mean = {(before * mean.value + weight * own.value) / (before + weight),
                1 / std::sqrt(before + weight)};
        continue;
      }
    }
    runs.push_back({{static_cast<int>(session)}, own});
  }
  return runs;
}

}  // namespace

void SetVerdict(bool apart, bool steady, ComparedValue* value) {
  std::vector<SessionEstimate> known;
  std::vector<int> sessions;
  for (size_t session = 0; session < value->by_session.size(); ++session) {
    const std::optional<engine::ParameterEstimate>& estimate = value->by_session[session];
    if (!estimate || !(estimate->std_error > 0)) continue;  // not measured, or at a bound
    known.push_back({estimate->value, estimate->std_error});
    sessions.push_back(static_cast<int>(session));
  }
  const ControlChart chart = MakeControlChart(known);
  value->limits.assign(value->by_session.size(), std::nullopt);
  bool outside = false;
  for (size_t i = 0; i < chart.limits.size(); ++i) {
    value->limits[sessions[i]] = chart.limits[i];
    outside = outside || chart.limits[i].outside;
  }
  value->change = apart                ? ValueChange::kChanged
                  : steady && !outside ? ValueChange::kUnchanged
                                       : ValueChange::kCannotSay;
  value->scatter = apart && known.size() >= kJointRules.min_for_scatter ? chart.inside.std_deviation : 0;
  value->runs = apart ? RunsOf(*value) : std::vector<SessionRun>();
}

ComparedEffect DescribeGroup(const SessionEvidence& evidence, const SessionChoice& choice, int group) {
  return GroupDescriber(evidence, choice).Compared(group);
}

}  // namespace touchstone::diagnosis::joint
