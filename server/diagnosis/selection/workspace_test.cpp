#include "server/diagnosis/selection/workspace.h"
#include "server/diagnosis/selection/rules.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis::selection {
namespace {

TEST(Workspace, SearchesAllTouchesOfASmallSet) {
  const auto workspace = MakeWorkspace(touches::MakeTestInput({}), {});
  ASSERT_TRUE(workspace.ok()) << workspace.status();
  ASSERT_TRUE(PrepareSearch(workspace->get(), {}).ok());
  EXPECT_FALSE((*workspace)->thinned);
  EXPECT_EQ((*workspace)->searched->size(), (*workspace)->observations->size());
  EXPECT_EQ((*workspace)->likelihood->rows(), (*workspace)->rows->rows());
}

TEST(Workspace, ThinsALargeSetToWholePosesOfEveryObject) {
  touches::HiddenRig rig;
  rig.samples_per_face = 50;
  rig.rounds = 6;  // 5,400 touches
  const auto workspace = MakeWorkspace(touches::MakeTestInput(rig), {});
  ASSERT_TRUE(workspace.ok()) << workspace.status();
  ASSERT_TRUE(PrepareSearch(workspace->get(), {}).ok());
  const touches::Observations& searched = *(*workspace)->searched;
  EXPECT_TRUE((*workspace)->thinned);
  const int used = static_cast<int>(std::count(searched.used.begin(), searched.used.end(), 1));
  EXPECT_LE(used, kSelectionRules.max_searched);
  EXPECT_GT(used, kSelectionRules.max_searched / 2);
  std::vector<int> of_object(searched.objects.size()), of_pose(searched.poses);
  for (int k = 0; k < searched.size(); ++k)
    if (searched.used[k]) ++of_object[searched.object[k]], ++of_pose[searched.pose[k]];
  for (const int touches : of_object) EXPECT_GT(touches, used / 6);
  for (const int touches : of_pose) EXPECT_LE(touches, 4);
}

TEST(Workspace, SearchesManyRepeatsOfFewPosesOverTheWholeSession) {
  touches::HiddenRig rig;
  rig.samples_per_face = 4;
  rig.rounds = 50;  // 3,600 touches, 72 poses
  const auto workspace = MakeWorkspace(touches::MakeTestInput(rig), {});
  ASSERT_TRUE(workspace.ok()) << workspace.status();
  ASSERT_TRUE(PrepareSearch(workspace->get(), {}).ok());
  const touches::Observations& all = *(*workspace)->observations;
  const touches::Observations& searched = *(*workspace)->searched;
  EXPECT_TRUE((*workspace)->thinned);
  const int used = static_cast<int>(std::count(searched.used.begin(), searched.used.end(), 1));
  EXPECT_LE(used, kSelectionRules.max_searched);
  EXPECT_GT(used, 0.9 * kSelectionRules.max_searched);
  // Of each object's stretch of the session every tenth part is seen alike.
  std::vector<int> of_part(10 * rig.objects.size());
  for (int k = 0; k < searched.size(); ++k) {
    const int number = searched.row[k] % (all.size() / 3);
    if (searched.used[k]) ++of_part[10 * searched.object[k] + 10 * number / (all.size() / 3)];
  }
  for (const int touches : of_part) EXPECT_NEAR(touches, used / 30, used / 75);
}

TEST(Workspace, WeighsTheRowsOfATouchByTheRootOfItsWeight) {
  const auto workspace = MakeWorkspace(touches::MakeTestInput({}), {});
  ASSERT_TRUE(workspace.ok()) << workspace.status();
  ASSERT_TRUE(PrepareSearch(workspace->get(), {}).ok());
  const Eigen::VectorXd plain = (*workspace)->rows->Residual((*workspace)->searched_nominal.time_s);
  std::vector<double> weights((*workspace)->input.set->size(), 1.0);
  const int first_row = (*workspace)->searched->row[(*workspace)->contrasts->touches()[0]];
  weights[first_row] = 0.25;
  ASSERT_TRUE(PrepareSearch(workspace->get(), weights).ok());
  const Eigen::VectorXd weighted = (*workspace)->rows->Residual((*workspace)->searched_nominal.time_s);
  ASSERT_EQ(weighted.size(), plain.size());
  EXPECT_DOUBLE_EQ(weighted[0], 0.5 * plain[0]);
  EXPECT_DOUBLE_EQ(weighted[plain.size() - 1], plain[plain.size() - 1]);
}

TEST(Workspace, LeavesOutTouchesOfWhichTheModelMissesTooManyFingers) {
  DiagnosisInput input = touches::MakeTestInput({});
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  // One touch, far beside the object.
  set->target_m[0] += 0.5 * set->approach[0].cross(set->lateral[0]);
  input.set = set;
  const auto workspace = MakeWorkspace(input, {});
  ASSERT_TRUE(workspace.ok()) << workspace.status();
  const touches::Observations& o = *(*workspace)->observations;
  const int k = static_cast<int>(std::find(o.row.begin(), o.row.end(), 0) - o.row.begin());
  EXPECT_FALSE(o.used[k]);
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
