#include "server/diagnosis/selection/ladder/doubts.h"

#include <gtest/gtest.h>

#include "server/diagnosis/engine/fit/linear_test_model.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr char kEffect[] = "object_push";
constexpr double kColumn = 50, kSigma = 0.005;

// The probability of a step of 0.9 after the doubt, where rows follow the effect's column times `sizes` of their block.
double AfterDoubt(const std::function<double(int block)>& sizes) {
  engine::LinearTestModel rows(4, 25, 2);
  rows.columns[kEffect] = rows.Random(1, kColumn);
  rows.measured = rows.Random(2, kSigma);
  for (int row = 0; row < rows.rows(); ++row)
    rows.measured[row] += sizes(rows.BlockOfRow(row)) * rows.columns[kEffect][row];
  const engine::Likelihood likelihood(rows.GroupRows(), nullptr, 0, nullptr);
  Workspace workspace;
  workspace.experiment.observations = &rows;
  workspace.experiment.likelihood = &likelihood;
  engine::Parameterization model(model::NominalModel(), rows.groups());
  model.Add(effects::Catalogue().Find(kEffect), false);
  const engine::Fit fit = *engine::FitModel(workspace.experiment, model);
  Ladder ladder;
  ladder.steps.emplace_back().effect = kEffect;
  ladder.steps[0].probability = 0.9;
  DoubtCarriedByFewPoses(workspace, fit, {engine::SelectedStep()}, &ladder);
  EXPECT_EQ(ladder.steps[0].probability < 0.9, !ladder.steps[0].words.empty());
  return ladder.steps[0].probability;
}

TEST(DoubtCarriedByFewPoses, LetsAnEffectStandThatEveryPoseShows) {
  EXPECT_EQ(AfterDoubt([](int) { return 1e-4; }), 0.9);
}

// The kind: positions that a controller rounds to 1 mm were tip_radius at P 0.78, and fresh touches showed nothing of it.
TEST(DoubtCarriedByFewPoses, DoubtsAnEffectOfThreePosesWithLargeErrors) {
  EXPECT_EQ(AfterDoubt([](int block) { return block % 40 == 0 ? 4e-3 : 0; }), 0.5);
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
