#include "server/diagnosis/boards/board_rows.h"

#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

#include "server/base/numbers/random.h"
#include "server/diagnosis/boards/board_test_set.h"
#include "server/diagnosis/engine/fit/fit.h"
#include "server/diagnosis/engine/fit/held_out.h"

namespace touchstone::diagnosis::boards {
namespace {

const LensVector kLens = LensOfAllEntries();

// Every effect of a lens, at values that change nothing, free. Their values in the order of LensEntry.
engine::Parameterization EveryEffect() {
  engine::Parameterization model(model::NominalModel(), {});
  for (const auto& effect : NamedLensEffects()) model.Add(effect, false);
  for (const auto& effect : NamelessLensEffects()) model.Add(effect, false);
  return model;
}

// The rows of a set, and what a fit of the engine needs beside them.
struct Engine {
  explicit Engine(BoardSet made) : set(std::move(made)), rows(*BoardRows::Make(set, model::NominalModel())) {
    likelihood = std::make_unique<engine::Likelihood>(rows->GroupRows(), nullptr, 1e-3, nullptr);
    likelihood->SetEliminated(rows->EliminatedValues());
    experiment.observations = rows.get();
    experiment.likelihood = likelihood.get();
  }
  Eigen::VectorXd ResidualAt(const model::Model& model) const {
    return rows->Residual(*rows->Predict(model));
  }
  BoardSet set;
  std::unique_ptr<BoardRows> rows;
  std::unique_ptr<engine::Likelihood> likelihood;
  engine::Experiment experiment;
};

// What a fit of each picture's pose leaves of noise: six directions a picture less, and of what it has left already, all.
TEST(BoardRows, TakeTheMovesOfEachBoardOutOfNoise) {
  const BoardSet set = MakeBoardSet(LensVector::Zero(), 6, 0.2, 1);
  const Engine engine(set);
  const Eigen::VectorXd left = engine.ResidualAt(model::NominalModel());
  EXPECT_LT((engine.rows->WithoutEliminated(left) - left).norm(), 1e-3 * left.norm());
  Eigen::MatrixXd noise(engine.rows->rows(), 50);
  RandomStream random(2, RandomDomain::kTest);
  for (double& value : noise.reshaped()) value = random.Normal();
  const double expected = 50.0 * (engine.rows->rows() - engine.rows->EliminatedValues());
  EXPECT_NEAR(engine.rows->WithoutEliminated(noise).squaredNorm(), expected, 4 * std::sqrt(2 * expected));
}

TEST(BoardRows, AreZeroAtTheLensThatMadeTheSet) {
  const BoardSet set = MakeBoardSet(kLens, 6, 0, 1);
  const Engine engine(set);
  const engine::Parameterization model = EveryEffect();
  ASSERT_EQ(model.size(), static_cast<int>(kLensEntries));
  EXPECT_EQ(engine.rows->rows(), 6 * 2 * 54);
  EXPECT_GT(engine.ResidualAt(model::NominalModel()).norm(), 1);
  EXPECT_LT(engine.ResidualAt(model.At(kLens)).norm(), 1e-4);
}

TEST(BoardRows, TheNoiseIsJudgedByWhatPosesAndLensLeave) {
  double sum = 0;
  for (int seed = 0; seed < 20; ++seed) {
    const Engine engine(MakeBoardSet(LensVector::Zero(), 5, 0.2, 100 + seed));
    sum += engine::FitModel(engine.experiment, EveryEffect())->sigma / 20;
  }
  EXPECT_NEAR(sum, 0.2, 0.003);  // without the poses' 30 values: 0.194
}

TEST(BoardRows, DerivativesAreThoseOfRowsWithEveryPoseFittedAnew) {
  const BoardSet set = MakeBoardSet(kLens, 6, 0.2, 3);
  const Engine engine(set);
  const engine::Parameterization model = EveryEffect();
  const Eigen::VectorXd at = kLens;
  const std::vector<double> predicted = *engine.rows->Predict(model.At(at));
  const Eigen::MatrixXd derivatives = *engine::Derivatives(engine.experiment, model, at, predicted, 0);
  for (int entry = 0; entry < kLensEntries; ++entry) {
    const double step = 0.01 * model.parameters()[entry].scale;
    Eigen::VectorXd more = at, less = at;
    more[entry] += step, less[entry] -= step;
    const Eigen::VectorXd anew =
        (engine.ResidualAt(model.At(less)) - engine.ResidualAt(model.At(more))) / (2 * step);
    EXPECT_LT((derivatives.col(entry) - anew).norm(), 0.01 * anew.norm()) << entry;
  }
}

TEST(BoardRows, AFitFindsEveryValueOfALensFromExactCorners) {
  const BoardSet set = MakeBoardSet(kLens, 12, 0, 2);
  const Engine engine(set);
  const absl::StatusOr<engine::Fit> fit = engine::FitModel(engine.experiment, EveryEffect());
  ASSERT_TRUE(fit.ok()) << fit.status();
  EXPECT_LT(fit->columns.values.col(0).squaredNorm(), 1e-4);
  EXPECT_LT((fit->point - kLens).cwiseAbs().maxCoeff(), 0.02);
}

// What one picture shows alone does not enter the lens that it is judged by.
TEST(BoardRows, ALeftOutPictureIsJudgedByTheOthersLens) {
  BoardSet set = MakeBoardSet(LensWith({{kFocal, 0.05}}), 8, 0.05, 3);
  for (Eigen::Vector2d& corner : set.pictures[5].corners_px) corner.x() = 320 + 0.9 * (corner.x() - 320);
  const Engine engine(set);
  engine::Parameterization focal(model::NominalModel(), {});
  focal.Add(NamedLensEffects()[0], false);
  const engine::Fit fit = *engine::FitModel(engine.experiment, focal);
  const std::vector<double> linear = engine::HeldOutSquares(engine.experiment, fit);
  const std::vector<double> anew = *engine::HeldOutSquaresRefitted(engine.experiment, fit);
  ASSERT_EQ(linear.size(), 8u);
  ASSERT_EQ(anew.size(), 8u);
  BoardSet others = set;
  others.pictures.erase(others.pictures.begin() + 5);
  const Engine without(others);
  const engine::Fit alone = *engine::FitModel(without.experiment, focal);
  EXPECT_GT(std::abs(alone.point[0] - fit.point[0]), 3e-3);
  std::vector<int> rows(engine.rows->FirstRowOfGroup(6) - engine.rows->FirstRowOfGroup(5));
  std::iota(rows.begin(), rows.end(), engine.rows->FirstRowOfGroup(5));
  const double by_others = *engine.rows->SquaresOfUnseen(alone.model.base(), rows);
  EXPECT_NEAR(anew[5], by_others, 1e-3 * by_others);
  EXPECT_NEAR(linear[5], by_others, 0.05 * by_others);
}

}  // namespace
}  // namespace touchstone::diagnosis::boards
