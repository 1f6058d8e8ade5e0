#include "server/diagnosis/engine/fit/resampled_covariance.h"

#include <gtest/gtest.h>

#include "server/diagnosis/engine/fit/linear_test_model.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::engine {
namespace {

struct Resampled {
  // Rows that all follow one value, with an error of each block and one of each row.
  Resampled() : rows(1, 50, 4), likelihood(rows.GroupRows(), nullptr, 0, nullptr) {
    rows.columns["object_push"] = Eigen::VectorXd::Ones(rows.rows());
    const Eigen::VectorXd of_block = rows.Random(1, 1e-3), of_row = rows.Random(2, 1e-4);
    for (int row = 0; row < rows.rows(); ++row)
      rows.measured[row] = 0.02 + of_block[rows.BlockOfRow(row)] + of_row[row];
    experiment.observations = &rows;
    experiment.likelihood = &likelihood;
    Parameterization model(model::NominalModel(), rows.groups());
    model.Add(effects::Catalogue().Find("object_push"), false);
    fit = *FitModel(experiment, model);
  }
  LinearTestModel rows;
  Likelihood likelihood;
  Experiment experiment;
  Fit fit;
};

TEST(ResampledCovariance, OfAMeanIsTheVarianceBetweenBlocksOverTheirNumber) {
  const Resampled set;
  double sum = 0, squares = 0;
  for (int block = 0; block < 50; ++block) {
    const double mean = set.rows.measured.segment(4 * block, 4).mean();
    sum += mean, squares += mean * mean;
  }
  const double variance = (squares / 50 - (sum / 50) * (sum / 50)) / 50;
  // 200 draws tell a variance to a tenth.
  EXPECT_NEAR(ResampledCovariance(set.experiment, set.fit, 3)(0, 0), variance, 0.3 * variance);
  EXPECT_GT(variance, 2 * set.fit.covariance(0, 0));  // which takes every row for itself
}

TEST(ResampledCovariance, FollowsTheSeed) {
  const Resampled set;
  const Eigen::MatrixXd one = ResampledCovariance(set.experiment, set.fit, 1);
  EXPECT_EQ(one, ResampledCovariance(set.experiment, set.fit, 1));
  EXPECT_NE(one, ResampledCovariance(set.experiment, set.fit, 2));
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
