// One number over all that was tried: how often data of the given model look as bad as these in the worst of all hypotheses.
// Each hypothesis gives a p value for the data and for draws from the given model; the least of each draw is compared with the
// least of the data (Westfall and Young's min-P), so that hypotheses may depend on one another in any way. Where several kinds
// are measured, the hypotheses are those of all kinds.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "server/diagnosis/engine/competition/result.h"
#include "server/diagnosis/engine/effect_columns.h"
#include "server/diagnosis/engine/fit/observation_model.h"
#include "server/diagnosis/engine/rules.h"

namespace touchstone::diagnosis::engine {

// p values of what was tried on one kind of measurement: hypotheses x (1 + draws); column 0 has those of the data. Empty: this
// kind cannot say.
using TriedPValues = Eigen::MatrixXd;

// Further columns that would explain rows: an effect's derivatives, the hats of a curve.
class LinearHypotheses {
 public:
  // `eliminated`: degrees of freedom that values of the rows' own take (ObservationModel::EliminatedValues).
  // `clusters`: first row of each part whose rows may share their errors (corners of a picture), then the number of rows; none:
  // rows err independently.
  explicit LinearHypotheses(int eliminated = 0, std::vector<int> clusters = {})
      : eliminated_(eliminated), clusters_(std::move(clusters)) {}

  // `columns`: rows `first_row` .. of the data, which may be all of them. Of no rank: not tried.
  void Add(const Eigen::MatrixXd& columns, int first_row = 0);
  // Anything at all in these rows, which are less than half of the data's.
  void AddRows(int first_row, int rows);
  // Every effect of a search, on all groups, with a value per group or on one group alone.
  void AddEffects(const ObservationModel& rows, const std::vector<EffectColumns>& effects);
  int size() const { return static_cast<int>(bases_.size()); }

  // p value of each hypothesis (rows) for each draw (columns of `residuals`): F test of what the columns take off. With clusters the
  // noise of what they take is that which differs from cluster to cluster, where it is more than rows that err independently make; p is 1 where clusters are too few to say.
  Eigen::MatrixXd PValues(const Eigen::MatrixXd& residuals) const;

 private:
  struct Basis {
    Eigen::MatrixXd columns;  // orthonormal
    int first_row = 0;
  };
  using Parts = std::vector<std::pair<int, int>>;  // first row within the basis, rows
  // Of the clusters that a basis has rows in.
  Parts PartsOf(const Basis& basis) const;
  // By how much what a basis takes off `residual` scatters more from cluster to cluster than rows of this variance make it.
  static double Overdispersion(const Basis& basis, const Parts& parts, const Eigen::VectorXd& residual,
                               double variance);

  std::vector<Basis> bases_;
  int eliminated_ = 0;
  std::vector<int> clusters_;
};

// Columns: `residual`, then what noise alone leaves of these rows, of variance 1 in each direction that they have.
Eigen::MatrixXd DataAndNoise(const ObservationModel& rows, const Eigen::VectorXd& residual, uint64_t seed,
                             int draws = kEngineRules.noise_draws);

// Columns: `residual` of a model that nothing was fitted of, then the same with the signs of whole clusters turned at random, which
// says nothing else where errors of clusters are independent and as often above as below. `clusters` as of LinearHypotheses.
Eigen::MatrixXd DataAndTurned(const Eigen::VectorXd& residual, const std::vector<int>& clusters,
                              uint64_t seed, int draws = kEngineRules.noise_draws);

// p values of statistics (hypotheses x draws, in any unit) of which draws 1, 2, ... show mean and spread: either tail.
Eigen::MatrixXd PValuesOfStatistics(const Eigen::MatrixXd& statistics);

// Of data that agree with the model to rounding, which no hypothesis betters, and of data whose model leaves no room for what
// they show: whatever is drawn.
TriedPValues AgreeingPValues(int hypotheses);
TriedPValues ImpossiblePValues(int hypotheses);

struct NothingMissing {
  double p =
      1;  // 0 to 1; from draws at least 1 / (draws + 1), or the least p value times the hypotheses where that is less
  int hypotheses = 0;
};
NothingMissing WorstOfAll(const TriedPValues& p_values);
// With one more hypothesis that no draw was judged by: its p value is paid for by all that were tried.
NothingMissing WithFurther(NothingMissing worst, double p);
// With what a verdict of UNEXPLAINED rests on: what the rest depends on, and `p` of what shows it beside.
NothingMissing WithRest(const NothingMissing& worst, const UnexplainedRest& rest, double p = 1);
// Over the hypotheses of all kinds, whose noise is independent. None: a kind cannot say, or there is none.
std::optional<NothingMissing> WorstOfKinds(const std::vector<const TriedPValues*>& kinds);

}  // namespace touchstone::diagnosis::engine
