#include "server/diagnosis/selection/session/round_structure.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "server/base/numbers/decompositions.h"
#include "server/base/numbers/distributions.h"
#include "server/base/numbers/random.h"
#include "server/base/text/readable_time.h"
#include "server/base/units.h"
#include "server/diagnosis/selection/rules.h"
#include "server/diagnosis/selection/session/pose_columns.h"
#include "server/diagnosis/selection/session/rules.h"

namespace touchstone::diagnosis::selection {
namespace {

// The touches of one object with all their fingers, each with its pose and round.
struct ObjectRounds {
  std::vector<int> touch, pose, round;
  int rounds = 0;
};

std::vector<ObjectRounds> RoundsOf(const touches::Observations& o, const touches::Prediction& d,
                                   const std::vector<double>& residuals) {
  std::vector<ObjectRounds> objects(o.objects.size());
  std::vector<std::map<int, int>> numbers(o.objects.size());
  for (int k = 0; k < o.size(); ++k) {
    if (!o.used[k] || !HasPoseColumns(o, d, residuals, k)) continue;
    ObjectRounds& object = objects[o.object[k]];
    std::map<int, int>& seen = numbers[o.object[k]];
    object.touch.push_back(k);
    object.pose.push_back(o.pose[k]);
    object.round.push_back(seen.emplace(o.set->round[o.row[k]], static_cast<int>(seen.size())).first->second);
    object.rounds = static_cast<int>(seen.size());
  }
  return objects;
}

// What a pose in every round explains of the residuals of one object, repeats centred.
struct ObjectFit {
  const ObjectRounds* rounds = nullptr;
  Eigen::MatrixXd basis;  // orthonormal
  Eigen::VectorXd residuals;
};

struct Squares {
  double all = 0, explained = 0, all_dof = 0, explained_dof = 0;
  double translation_m2 = 0;
  int translations = 0;
  std::vector<ObjectFit> fits;
};

void AddObject(const touches::Observations& o, const touches::Prediction& d,
               const std::vector<double>& residuals, const ObjectRounds& object, Squares* squares) {
  const int n = static_cast<int>(object.touch.size()) * o.fingers, values = object.rounds * kPoseValues;
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(n, 1 + values);
  for (int t = 0; t < static_cast<int>(object.touch.size()); ++t) {
    const int k = object.touch[t];
    for (int i = 0; i < o.fingers; ++i)
      rows(t * o.fingers + i, 0) = residuals[static_cast<size_t>(k) * o.fingers + i];
    rows.block(t * o.fingers, 1 + object.round[t] * kPoseValues, o.fingers, kPoseValues) =
        PoseColumns(o, d, k);
  }
  const int repeats = CentrePoses(object.pose, o.fingers, &rows);
  const ColumnSpan span(rows.rightCols(values));
  const double dof = static_cast<double>(repeats) * (o.fingers - 1);
  if (dof < static_cast<double>(span.rank()) + kSessionRules.min_round_dof) return;
  const Eigen::VectorXd moved = span.Solve(rows.col(0));  // the least: about the mean of the rounds
  const Eigen::MatrixXd basis = span.Basis();
  squares->fits.push_back({&object, basis, rows.col(0)});
  squares->all += rows.col(0).squaredNorm();
  squares->explained += (basis.transpose() * rows.col(0)).squaredNorm();
  squares->all_dof += dof;
  squares->explained_dof += static_cast<double>(span.rank());
  for (int round = 0; round < object.rounds; ++round)
    squares->translation_m2 += moved.segment<3>(round * kPoseValues).squaredNorm();
  squares->translations += 3 * object.rounds;
}

// What the rounds explain once the repeats of each pose have changed places: noise that grows on slopes or has tails
// stays with its poses, and what the rounds share is gone.
double ExplainedInOtherOrder(const std::vector<ObjectFit>& fits, int fingers, RandomStream* random) {
  double explained = 0;
  for (const ObjectFit& fit : fits) {
    std::map<int, std::vector<int>> poses;
    for (int t = 0; t < static_cast<int>(fit.rounds->pose.size()); ++t)
      poses[fit.rounds->pose[t]].push_back(t);
    Eigen::VectorXd residuals(fit.residuals.size());
    for (const auto& [pose, members] : poses) {
      std::vector<int> from = members;
      for (size_t left = from.size(); left > 1; --left) std::swap(from[left - 1], from[random->Below(left)]);
      for (size_t m = 0; m < members.size(); ++m)
        residuals.segment(members[m] * fingers, fingers) = fit.residuals.segment(from[m] * fingers, fingers);
    }
    explained += (fit.basis.transpose() * residuals).squaredNorm();
  }
  return explained;
}

// Of so much agreement within rounds by chance: the tail of a gamma distribution with the mean and the variance of what
// other orders explain.
double PermutedP(const Squares& squares, int fingers) {
  RandomStream random(0, RandomDomain::kDiagnosis);
  double sum = 0, sum2 = 0;
  for (int n = 0; n < kSelectionRules.orders; ++n) {
    const double explained = ExplainedInOtherOrder(squares.fits, fingers, &random);
    sum += explained, sum2 += explained * explained;
  }
  const double mean = sum / kSelectionRules.orders;
  const double variance = (sum2 - sum * mean) / (kSelectionRules.orders - 1);
  if (!(mean > 0) || !(variance > 0)) return 1;
  return GammaTail(std::max(squares.explained, 0.0), mean, variance);
}

}  // namespace

RoundStructure FindRoundStructure(const touches::Observations& o, const touches::Prediction& d,
                                  const std::vector<double>& residuals) {
  RoundStructure found;
  if (o.fingers < 2 || !HasPoseDetails(d, residuals) || o.set->round.empty()) return found;
  Squares squares;
  const std::vector<ObjectRounds> objects = RoundsOf(o, d, residuals);
  for (const ObjectRounds& object : objects)
    if (object.rounds >= 2 && object.rounds <= kSessionRules.max_rounds)
      AddObject(o, d, residuals, object, &squares);
  const double rest_dof = squares.all_dof - squares.explained_dof;
  const double rest = squares.all - squares.explained;
  if (!(squares.explained_dof > 0) || !(rest_dof > 0) || !(rest > 0)) return found;
  found.sigma_s = std::sqrt(rest / rest_dof);
  found.translation_m = std::sqrt(squares.translation_m2 / squares.translations);
  found.gain_nats = 0.5 * squares.all_dof * std::log(squares.all / rest) -
                    0.5 * squares.explained_dof * std::log(squares.all_dof);
  const double f = std::max(squares.explained / squares.explained_dof / (rest / rest_dof), 0.0);
  found.p = FisherTail(f, squares.explained_dof, rest_dof);
  // The F test takes noise of one size for granted.
  if (found.p < kSessionRules.permuted_below_p) found.p = std::max(found.p, PermutedP(squares, o.fingers));
  return found;
}

bool SharesRounds(const RoundStructure& rounds, double sigma_s) {
  return rounds.p < kSessionRules.round_p && rounds.sigma_s < (1 - kSessionRules.negligible_rounds) * sigma_s;
}

std::string RoundsInWords(const RoundStructure& rounds, double sigma_s) {
  return absl::StrFormat(
      "In every round the object lay elsewhere, by about %.2g mm: repeats differ by %s, but only by %s once "
      "each round has a pose of the object of its own. Fix the object, or register it anew after each round.",
      rounds.translation_m * kMillimetresPerMetre, TimeInWords(sigma_s), TimeInWords(rounds.sigma_s));
}

void NameRoundFirst(const RoundStructure& rounds, engine::UnexplainedRest* rest) {
  engine::PutFirst({"round", rounds.p, rounds.gain_nats}, rest);
}

}  // namespace touchstone::diagnosis::selection
