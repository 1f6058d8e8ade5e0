#include "server/diagnosis/engine/fit/likelihood.h"

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <cmath>

#include "server/base/numbers/random.h"
#include "server/diagnosis/touches/predictor.h"
#include "server/diagnosis/touches/simulated_test_set.h"
#include "server/diagnosis/touches/touch_observation_model.h"

namespace touchstone::diagnosis::touches {
namespace {

HiddenRig SmallRig() {
  HiddenRig rig;
  rig.objects = {"lat00", "lat20"};
  rig.samples_per_face = rig.rounds = 2;
  return rig;
}

class SurfaceErrorTest : public ::testing::Test {
 protected:
  SurfaceErrorTest() : input(MakeTestInput(SmallRig())) {
    observations = std::make_unique<Observations>(*MakeObservations(input));
    details = *Predict(*observations, *input.model, true, false, nullptr);
    contrasts = std::make_unique<Contrasts>(*observations, details.time_s);
    const engine::SmoothErrorGeometry geometry = SurfaceErrorGeometry(*observations, *contrasts, details);
    likelihood = std::make_unique<engine::Likelihood>(
        FirstRowsOfObjects(*contrasts, static_cast<int>(observations->objects.size())), &geometry, 0,
        nullptr);
  }
  Eigen::VectorXd Noise(uint64_t seed) const {
    RandomStream random(seed, RandomDomain::kTest);
    Eigen::VectorXd noise(likelihood->rows());
    for (int row = 0; row < noise.size(); ++row) noise[row] = random.Normal();
    return noise;
  }
  DiagnosisInput input;
  std::unique_ptr<Observations> observations;
  Prediction details;
  std::unique_ptr<Contrasts> contrasts;
  std::unique_ptr<engine::Likelihood> likelihood;
};

// The covariance of contrasts under a hypothesis, element by element from its definition.
Eigen::MatrixXd DenseCovariance(const SurfaceErrorTest&, const Observations& o, const Contrasts& c,
                                const Prediction& d, const engine::SurfaceErrorHypothesis& surface) {
  const int entries = static_cast<int>(o.time_s.size());
  Eigen::MatrixXd field = Eigen::MatrixXd::Zero(entries, entries);
  for (int a = 0; a < entries; ++a)
    for (int b = 0; b < entries; ++b) {
      if (std::isnan(d.time_s[a]) || std::isnan(d.time_s[b])) continue;
      if (o.object[a / 3] != o.object[b / 3]) continue;
      const double x = std::sqrt(5.0) * (d.contact_m[a] - d.contact_m[b]).norm() / surface.length_m;
      const double gain_a = d.inverse_speed_s_per_m[a] / std::max(d.cos_incidence[a], 0.1);
      const double gain_b = d.inverse_speed_s_per_m[b] / std::max(d.cos_incidence[b], 0.1);
      field(a, b) = surface.amplitude_over_sigma * surface.amplitude_over_sigma * gain_a * gain_b *
                    (1 + x + x * x / 3) * std::exp(-x);
    }
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(c.rows(), entries);
  for (size_t t = 0; t < c.touches().size(); ++t)
    h.block(c.FirstRow(static_cast<int>(t)), c.touches()[t] * 3, c.MatrixOf(static_cast<int>(t)).rows(), 3) =
        c.MatrixOf(static_cast<int>(t));
  return Eigen::MatrixXd::Identity(c.rows(), c.rows()) + h * field * h.transpose();
}

TEST_F(SurfaceErrorTest, IsTheGaussianWithTheFieldsCovariance) {
  for (const int s : {0, 5, 20, 40, 65}) {
    const engine::SurfaceErrorHypothesis& surface = likelihood->hypotheses()[s];
    Eigen::MatrixXd v = Eigen::MatrixXd::Identity(likelihood->rows(), likelihood->rows());
    if (s > 0) v = DenseCovariance(*this, *observations, *contrasts, details, surface);
    const Eigen::VectorXd r = Noise(s);
    const double expected = r.dot(v.ldlt().solve(r));
    EXPECT_NEAR(likelihood->Gram(likelihood->Prepare(r), s)(0, 0), expected, 2e-3 * expected) << s;
    const double log_determinant = v.ldlt().vectorD().array().log().sum();
    EXPECT_NEAR(surface.log_determinant, log_determinant, 0.02 * std::abs(log_determinant) + 0.05) << s;
  }
}

TEST_F(SurfaceErrorTest, PredictsRowsLeftOutFromTheOthersOnly) {
  constexpr int kFolds = 3;
  constexpr int kHypothesis = 40;
  const Eigen::MatrixXd v =
      DenseCovariance(*this, *observations, *contrasts, details, likelihood->hypotheses()[kHypothesis]);
  Eigen::MatrixXd columns(likelihood->rows(), 2);
  const Eigen::MatrixXd lower = v.llt().matrixL();
  columns.col(0) = lower * Noise(1);
  columns.col(1) = Noise(2);
  std::vector<int> fold_of_row(likelihood->rows());
  std::vector<std::vector<int>> outside(kFolds), inside(kFolds);
  for (int row = 0; row < likelihood->rows(); ++row) {
    fold_of_row[row] = row / 2 % kFolds;
    for (int fold = 0; fold < kFolds; ++fold)
      (fold == fold_of_row[row] ? inside : outside)[fold].push_back(row);
  }
  std::vector<Eigen::MatrixXd> grams;
  const Eigen::MatrixXd expected =
      likelihood->FieldLeftOut(columns, kHypothesis, fold_of_row, kFolds, &grams);
  const auto part = [&](const Eigen::MatrixXd& of, const std::vector<int>& rows,
                        const std::vector<int>& cols) {
    Eigen::MatrixXd picked(rows.size(), cols.size());
    for (size_t r = 0; r < rows.size(); ++r)
      for (size_t c = 0; c < cols.size(); ++c)
        picked(static_cast<int>(r), static_cast<int>(c)) = of(rows[r], cols[c]);
    return picked;
  };
  for (int fold = 0; fold < kFolds; ++fold) {
    const Eigen::MatrixXd kept = part(columns, outside[fold], {0, 1});
    const Eigen::MatrixXd solved = part(v, outside[fold], outside[fold]).ldlt().solve(kept);
    const Eigen::MatrixXd by_hand = part(v, inside[fold], outside[fold]) * solved;
    const Eigen::MatrixXd found = part(expected, inside[fold], {0, 1});
    EXPECT_LT((found - by_hand).norm(), 0.03 * by_hand.norm()) << fold;
    EXPECT_LT((grams[fold] - kept.transpose() * solved).norm(), 0.01 * grams[fold].norm()) << fold;
  }
}

TEST_F(SurfaceErrorTest, GramsOfPickedColumnsAreBlocksOfTheWhole) {
  Eigen::MatrixXd values(likelihood->rows(), 4);
  for (int c = 0; c < 4; ++c) values.col(c) = Noise(10 + c);
  const engine::Likelihood::Columns all = likelihood->Prepare(values);
  const Eigen::MatrixXd whole = likelihood->Gram(all, 30);
  const Eigen::MatrixXd part = likelihood->Gram(engine::Likelihood::Pick(all, {3, 1}), 30);
  EXPECT_NEAR(part(0, 1), whole(3, 1), 1e-9);
  const engine::Likelihood::Columns joined = engine::Likelihood::Join(
      engine::Likelihood::Pick(all, {0, 1}), likelihood->Prepare(values.rightCols(2)));
  EXPECT_LT((likelihood->Gram(joined, 30) - whole).norm(), 1e-9);
  EXPECT_NEAR(likelihood->Norms(all, 30)[2], whole(2, 2), 1e-9);
}

TEST_F(SurfaceErrorTest, TheFieldFollowsBumpsAndNotNoise) {
  // A bump along the normal of one object, 0.3 mm high.
  std::vector<double> bump(observations->time_s.size());
  for (size_t e = 0; e < bump.size(); ++e)
    bump[e] = -0.3e-3 *
              std::exp(-(details.contact_m[e] - details.contact_m[1]).squaredNorm() / (2 * 0.02 * 0.02)) *
              details.inverse_speed_s_per_m[e] / details.cos_incidence[e];
  const Eigen::VectorXd r = contrasts->Apply(bump);
  const engine::Likelihood::Columns columns = likelihood->Prepare(r);
  double best = 0;
  for (int s = 1; s < static_cast<int>(likelihood->hypotheses().size()); ++s)
    best = std::max(best, 1 - (r - likelihood->FieldMean(columns, s)).squaredNorm() / r.squaredNorm());
  EXPECT_GT(best, 0.97);
  EXPECT_EQ(likelihood->FieldMean(columns, 0).norm(), 0);
}

}  // namespace
}  // namespace touchstone::diagnosis::touches
