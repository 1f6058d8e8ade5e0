#include "server/diagnosis/images/terms/photo_term_scores.h"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <set>

#include "server/base/numbers/distributions.h"
#include "server/diagnosis/images/rules.h"
#include "server/diagnosis/images/terms/rules.h"

namespace touchstone::diagnosis::images {
namespace {

// Columns of very different sizes are scaled before they are solved for.
struct ScaledSolver {
  Eigen::VectorXd scale;
  Eigen::LDLT<Eigen::MatrixXd> ldlt;
  bool good = false;

  explicit ScaledSolver(const Eigen::MatrixXd& matrix) {
    scale = matrix.diagonal();
    for (int i = 0; i < scale.size(); ++i) {
      if (!(scale[i] > 0)) return;
      scale[i] = 1 / std::sqrt(scale[i]);
    }
    ldlt.compute(scale.asDiagonal() * matrix * scale.asDiagonal());
    good = ldlt.info() == Eigen::Success && ldlt.rcond() > kPhotoTermRules.min_reciprocal_condition;
  }
  Eigen::VectorXd Solve(const Eigen::VectorXd& right) const {
    return scale.cwiseProduct(ldlt.solve(scale.cwiseProduct(right)));
  }
  Eigen::MatrixXd SolveAll(const Eigen::MatrixXd& right) const {
    return scale.asDiagonal() * ldlt.solve(scale.asDiagonal() * right);
  }
};

double Taken(const PoseSums& pose, const Eigen::VectorXd& values) {
  return 2 * values.dot(pose.cross) - values.dot(pose.squares * values);
}

}  // namespace

TermScore ScoreSums(const std::vector<PoseSums>& poses, const std::vector<int>& objects,
                    const Eigen::MatrixXd& precision) {
  TermScore score;
  if (poses.empty()) return score;
  const int p = static_cast<int>(precision.rows()), groups = static_cast<int>(poses.size());
  PoseSums all{Eigen::MatrixXd::Zero(p, p), Eigen::VectorXd::Zero(p)};
  for (const PoseSums& pose : poses) all.squares += pose.squares, all.cross += pose.cross;
  const ScaledSolver plain(all.squares + 1e-9 * precision);
  if (!plain.good || groups <= p) return score;

  // What poses have in common with themselves alone is noise too: it widens the noise that counts.
  const Eigen::VectorXd least = plain.Solve(all.cross);
  Eigen::MatrixXd meat = Eigen::MatrixXd::Zero(p, p);
  for (const PoseSums& pose : poses) {
    const Eigen::VectorXd left = pose.cross - pose.squares * least;
    meat += left * left.transpose();
  }
  meat *= groups / static_cast<double>(groups - p);
  const double spread = std::max(plain.SolveAll(meat).trace() / p, 1.0);

  const ScaledSolver solver(all.squares + spread * precision);
  if (!solver.good) return score;
  score.determined = true;
  score.values = solver.Solve(all.cross);
  score.taken = Taken(all, score.values);
  // log det(I + S / (spread P)), P the prior's precision
  const auto log_det = [](const Eigen::MatrixXd& matrix) {
    const Eigen::LDLT<Eigen::MatrixXd> ldlt(matrix);
    return ldlt.vectorD().array().max(1e-300).log().sum();
  };
  const Eigen::VectorXd unit = solver.scale;
  const Eigen::MatrixXd prior = unit.asDiagonal() * (spread * precision) * unit.asDiagonal(),
                        both = unit.asDiagonal() * (all.squares + spread * precision) * unit.asDiagonal();
  score.gain_nats = 0.5 * all.cross.dot(score.values) / spread - 0.5 * (log_det(both) - log_det(prior));
  score.p = ChiSquaredTail(all.cross.dot(least) / spread, p);

  const size_t folds = kImageRules.folds;
  for (size_t fold = 0; fold < folds; ++fold) {
    PoseSums seen = all;
    for (size_t g = fold; g < poses.size(); g += folds)
      seen.squares -= poses[g].squares, seen.cross -= poses[g].cross;
    const ScaledSolver others(seen.squares + spread * precision);
    if (!others.good) continue;
    const Eigen::VectorXd values = others.Solve(seen.cross);
    for (size_t g = fold; g < poses.size(); g += folds) score.taken_unseen += Taken(poses[g], values);
  }
  const std::set<int> names(objects.begin(), objects.end());
  score.every_object = true;
  for (const int object : names) {
    if (names.size() < 2) break;
    PoseSums seen = all, own{Eigen::MatrixXd::Zero(p, p), Eigen::VectorXd::Zero(p)};
    for (size_t g = 0; g < poses.size(); ++g)
      if (objects[g] == object) own.squares += poses[g].squares, own.cross += poses[g].cross;
    seen.squares -= own.squares, seen.cross -= own.cross;
    const ScaledSolver others(seen.squares + spread * precision);
    score.every_object &= others.good && Taken(own, others.Solve(seen.cross)) > 0;
  }
  return score;
}

double UnseenOfMeans(const std::vector<Eigen::VectorXd>& squares, const std::vector<Eigen::VectorXd>& cross,
                     double size) {
  if (squares.empty()) return 0;
  const Eigen::Index cells = squares[0].size();
  Eigen::ArrayXd all_squares = Eigen::ArrayXd::Zero(cells), all_cross = Eigen::ArrayXd::Zero(cells);
  for (size_t g = 0; g < squares.size(); ++g)
    all_squares += squares[g].array(), all_cross += cross[g].array();
  double scatter = 0, seen_cells = 0;
  for (Eigen::Index c = 0; c < cells; ++c) {
    if (!(all_squares[c] > 0)) continue;
    double sum = 0;
    for (size_t g = 0; g < squares.size(); ++g)
      sum += std::pow(cross[g][c] - squares[g][c] * all_cross[c] / all_squares[c], 2);
    scatter += sum / all_squares[c], ++seen_cells;
  }
  const double spread = std::max(scatter / std::max(seen_cells, 1.0), 1.0);
  double taken = 0;
  const size_t folds = kImageRules.folds;
  for (size_t fold = 0; fold < folds; ++fold) {
    Eigen::ArrayXd own_squares = Eigen::ArrayXd::Zero(cells), own_cross = Eigen::ArrayXd::Zero(cells);
    for (size_t g = fold; g < squares.size(); g += folds)
      own_squares += squares[g].array(), own_cross += cross[g].array();
    const Eigen::ArrayXd means =
        (all_cross - own_cross) / (all_squares - own_squares + spread / (size * size));
    taken += (2 * means * own_cross - means * means * own_squares).sum();
  }
  return taken;
}

}  // namespace touchstone::diagnosis::images
