#include "server/diagnosis/selection/session/repeats.h"

#include <gtest/gtest.h>

#include "server/diagnosis/selection/simulated_test_search.h"

namespace touchstone::diagnosis::selection {
namespace {

// A column that is the same in every touch of a pose, and one that only differs within poses.
class RepeatsTest : public ::testing::Test {
 protected:
  RepeatsTest() : repeats_(*workspace_->searched, *workspace_->contrasts) {
    const touches::Observations& o = *workspace_->searched;
    const touches::Contrasts& contrasts = *workspace_->contrasts;
    const int rows = contrasts.FirstRow(static_cast<int>(contrasts.touches().size()));
    Eigen::MatrixXd columns(rows, 2);
    for (size_t t = 0; t < contrasts.touches().size(); ++t)
      for (int row = contrasts.FirstRow(static_cast<int>(t));
           row < contrasts.FirstRow(static_cast<int>(t) + 1); ++row) {
        columns(row, 0) = o.pose[contrasts.touches()[t]] + 1.0;
        columns(row, 1) = static_cast<double>(t);
      }
    within_ = repeats_.Centred(columns.col(1));
    of_pose_ = columns.col(0) - repeats_.Centred(columns.col(0));
  }

  std::unique_ptr<Workspace> workspace_ = SelectFor(touches::MakeTestInput({})).workspace;
  Repeats repeats_;
  Eigen::VectorXd of_pose_, within_;
};

TEST_F(RepeatsTest, AValueThatPosesFixTakesNoDegreeOfFreedom) {
  EXPECT_NEAR(repeats_.DegreesTaken(of_pose_), 0, 1e-12);
}

TEST_F(RepeatsTest, AValueThatOnlyRepeatsKnowTakesOne) {
  EXPECT_NEAR(repeats_.DegreesTaken(within_), 1, 1e-12);
}

// As the pose of an object beside an effect of 6 % of the touch before.
TEST_F(RepeatsTest, AValueThatDiffersALittleWithinPosesTakesLittle) {
  const Eigen::VectorXd little = 0.06 * of_pose_.norm() / within_.norm() * within_;
  EXPECT_NEAR(repeats_.DegreesTaken(of_pose_ + little), 0.06 * 0.06, 1e-4);
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
