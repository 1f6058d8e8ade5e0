#include "server/diagnosis/joint/session_evidence.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <numeric>
#include <utility>

#include "server/base/numbers/distributions.h"
#include "server/base/status.h"
#include "server/diagnosis/joint/rules.h"

namespace touchstone::diagnosis::joint {
namespace {

constexpr int kStretches[] = {8, 24};  // of a session, in which errors may drift

// Rows by what they may share an error with: the repeats of a pose, stretches of the session.
std::vector<std::vector<int>> GroupingsOf(const engine::ObservationModel& rows) {
  std::vector<std::vector<int>> groupings(1 + std::size(kStretches), std::vector<int>(rows.rows()));
  double first = INFINITY, last = -INFINITY;
  for (int r = 0; r < rows.rows(); ++r)
    first = std::min(first, rows.TimeOfRow(r)), last = std::max(last, rows.TimeOfRow(r));
  for (int r = 0; r < rows.rows(); ++r) {
    groupings[0][r] = rows.BlockOfRow(r);
    const double share = last > first ? (rows.TimeOfRow(r) - first) / (last - first) : 0;
    for (size_t i = 0; i < std::size(kStretches); ++i)
      groupings[1 + i][r] = std::min(static_cast<int>(share * kStretches[i]), kStretches[i] - 1);
  }
  return groupings;
}

// By how much the variance of a value that follows `column` exceeds what independent rows give it, where rows of a block share
// errors: from the scatter of the blocks' scores (a sandwich estimator); 1 where chance gives as much.
double BlockFactor(const Eigen::VectorXd& column, const Eigen::VectorXd& residual, double sigma,
                   const std::vector<int>& block_of_row, double chance) {
  std::map<int, std::pair<double, double>> blocks;  // score, information
  for (Eigen::Index r = 0; r < column.size(); ++r) {
    auto& [score, information] = blocks[block_of_row[static_cast<size_t>(r)]];
    score += column[r] * residual[r], information += column[r] * column[r];
  }
  double squares = 0, sum = 0, sum2 = 0;
  for (const auto& [block, of] : blocks) {
    squares += of.first * of.first;
    sum += of.second, sum2 += of.second * of.second;
  }
  if (!(sum > 0)) return 1;
  const double factor = squares / (sum * sigma * sigma), degrees = sum * sum / sum2;
  return factor > 1 && ChiSquaredTail(factor * degrees, degrees) < chance ? factor : 1;
}

// Of the value that suffers most. Where a smooth error takes part it explains what rows of a place share.
double VarianceFactor(const engine::ObservationModel& rows, const engine::Fit& fit) {
  const Eigen::MatrixXd& columns = fit.columns.values;
  if (fit.hypothesis != 0 || !(fit.sigma > 0) || columns.cols() < 2) return 1;
  const std::vector<std::vector<int>> groupings = GroupingsOf(rows);
  const double chance = kJointRules.scatter_chance /
                        (static_cast<double>(groupings.size()) * static_cast<double>(columns.cols() - 1));
  double factor = 1;
  for (const std::vector<int>& grouping : groupings)
    for (Eigen::Index j = 1; j < columns.cols(); ++j)
      factor = std::max(factor, BlockFactor(columns.col(j), columns.col(0), fit.sigma, grouping, chance));
  return factor;
}

}  // namespace

absl::StatusOr<SessionEvidence> SessionEvidence::Create(const std::vector<Side>& sides,
                                                        const std::vector<SharedEffect>& effects) {
  SessionEvidence evidence;
  for (const Side& side : sides) {
    const engine::Experiment& experiment = side.modality->experiment();
    TOUCHSTONE_ASSIGN_OR_RETURN(engine::Fit fit, engine::FitModel(experiment, side.Free(effects, {})));
    const double factor = VarianceFactor(*experiment.observations, fit);
    evidence.variance_factors_.push_back(factor);
    evidence.independent_ += experiment.likelihood->rows() / factor;
    evidence.fits_.push_back(std::move(fit));
  }
  evidence.ListValues();
  evidence.PrepareForms(sides, effects);
  return evidence;
}

void SessionEvidence::ListValues() {
  for (int session = 0; session < sessions(); ++session) {
    std::vector<int>& own = value_of_.emplace_back();
    const engine::Parameterization& model = fits_[session].model;
    for (int j = 0; j < model.size(); ++j) {
      int same = -1;
      for (int earlier = 0; earlier < session && same < 0; ++earlier)
        for (int i = 0; i < fits_[earlier].model.size() && same < 0; ++i)
          if (IsSameValue(fits_[earlier].model, i, model, j)) same = value_of_[earlier][i];
      if (same < 0) {
        same = static_cast<int>(values_.size());
        values_.push_back({model.parameters()[j], -1});
      }
      own.push_back(same);
      const engine::FreeParameter& parameter = model.parameters()[j];
      const std::string name = engine::NameOf(*model.base().effects[parameter.effect].effect);
      auto group = std::find_if(groups_.begin(), groups_.end(), [&](const ValueGroup& g) {
        return g.effect == name && g.object == parameter.object;
      });
      if (group == groups_.end()) {
        group = groups_.insert(groups_.end(), ValueGroup());
        group->effect = name, group->object = parameter.object;
      }
      if (values_[same].group < 0) group->values.push_back(same);
      values_[same].group = static_cast<int>(group - groups_.begin());
      if (group->sessions.empty() || group->sessions.back() != session) group->sessions.push_back(session);
    }
  }
}

void SessionEvidence::PrepareForms(const std::vector<Side>& sides, const std::vector<SharedEffect>& effects) {
  for (ValueGroup& group : groups_)
    for (const SharedEffect& effect : effects) {
      if (effect.name() != group.effect) continue;
      const engine::SearchRules rules;
      group.given = effect.given;
      group.least_nats = effect.rare ? rules.enter_rare_nats : rules.enter_nats;
    }
  int rows = 0;
  for (int session = 0; session < sessions(); ++session) {
    const engine::Fit& fit = fits_[session];
    const engine::Likelihood& likelihood = *sides[session].modality->experiment().likelihood;
    Eigen::VectorXd given(fit.model.size());
    for (int j = 0; j < given.size(); ++j) given[j] = fit.model.parameters()[j].neutral;
    given = fit.model.Clip(given);
    // The residual there, to first order.
    Eigen::MatrixXd moved = Eigen::MatrixXd::Identity(given.size() + 1, given.size() + 1);
    moved.col(0).tail(given.size()) = fit.point - given;
    const Eigen::MatrixXd gram = likelihood.Gram(fit.columns, fit.hypothesis);
    forms_.push_back(moved.transpose() * gram * moved / (fit.sigma * fit.sigma * variance_factors_[session]));
    given_.push_back(given);
    rows += likelihood.rows();
  }
  unit_ = std::make_shared<engine::Likelihood>(std::vector<int>{0, rows}, nullptr, 0, nullptr);
  unit_->SetLeastNoise(1);
}

SharedEvidence SessionEvidence::Of(const std::vector<SessionValues>& states) const {
  SharedEvidence evidence;
  std::vector<engine::FreeParameter> parameters;
  std::vector<double> given;
  std::vector<int> shared(values_.size(), -1);
  for (int session = 0; session < sessions(); ++session) {
    std::vector<int>& place = evidence.place.emplace_back(value_of_[session].size(), -1);
    for (size_t j = 0; j < place.size(); ++j) {
      const int value = value_of_[session][j];
      const SessionValues state = states[values_[value].group];
      if (state == SessionValues::kGiven) continue;
      if (state == SessionValues::kShared && shared[value] >= 0) {
        place[j] = shared[value];
        continue;
      }
      place[j] = shared[value] = static_cast<int>(parameters.size());
      parameters.push_back(fits_[session].model.parameters()[j]);
      given.push_back(given_[session][static_cast<Eigen::Index>(j)]);
    }
  }
  const int free = evidence.free = static_cast<int>(parameters.size());
  Eigen::MatrixXd form = Eigen::MatrixXd::Zero(free + 1, free + 1);
  for (int session = 0; session < sessions(); ++session) {
    // Members of the session's form, the residual first.
    std::vector<std::pair<int, int>> members = {{0, 0}};
    for (size_t j = 0; j < evidence.place[session].size(); ++j)
      if (evidence.place[session][j] >= 0)
        members.emplace_back(static_cast<int>(j) + 1, evidence.place[session][j] + 1);
    for (const auto& [i, row] : members)
      for (const auto& [j, column] : members) form(row, column) += forms_[session](i, j);
  }
  std::vector<int> members(free + 1);
  std::iota(members.begin(), members.end(), 0);
  const engine::LaplaceEvidence found = engine::ComputeLaplaceEvidence(
      *unit_, {form}, members, parameters, Eigen::Map<const Eigen::VectorXd>(given.data(), free));
  evidence.log_evidence = found.log_evidence;
  evidence.step = found.step;
  evidence.covariance = found.covariance;
  Eigen::VectorXd along(free + 1);
  along << 1, -found.step;
  evidence.squares = along.dot(form * along);
  return evidence;
}

Eigen::VectorXd SessionEvidence::PointOf(const SharedEvidence& evidence, int session) const {
  Eigen::VectorXd point = given_[session];
  for (int j = 0; j < point.size(); ++j)
    if (const int place = evidence.place[session][j]; place >= 0) point[j] += evidence.step[place];
  return point;
}

Eigen::MatrixXd SessionEvidence::CovarianceOf(const SharedEvidence& evidence, int session, int other) const {
  const std::vector<int>&rows = evidence.place[session], &columns = evidence.place[other];
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(rows.size()),
                                                     static_cast<Eigen::Index>(columns.size()));
  for (size_t i = 0; i < rows.size(); ++i)
    for (size_t j = 0; j < columns.size(); ++j)
      if (rows[i] >= 0 && columns[j] >= 0)
        covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
            evidence.covariance(rows[i], columns[j]);
  return covariance;
}

double SessionEvidence::DegreesUnder(const SharedEvidence& evidence) const {
  return std::max(1.0, independent_ - evidence.free);
}

double SessionEvidence::MovesRows(int session, int value) const {
  const Eigen::VectorXd column = fits_[session].columns.values.col(value + 1);
  const double least = kJointRules.moved_share * column.cwiseAbs().maxCoeff();
  const auto moved = (column.cwiseAbs().array() > least).count();
  return moved == 0 ? 0 : column.norm() / std::sqrt(static_cast<double>(moved)) / fits_[session].sigma;
}

}  // namespace touchstone::diagnosis::joint
