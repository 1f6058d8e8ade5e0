#include "server/diagnosis/boards/board_pose.h"

#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

#include "server/diagnosis/boards/board_test_set.h"

namespace touchstone::diagnosis::boards {
namespace {

const LensVector kAllEntries = LensOfAllEntries();

BoardPose SomePose() {
  BoardPose pose;
  pose.rotation = Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, -2, 0.5).normalized()).toRotationMatrix();
  pose.translation_m = {-0.08, -0.05, 0.4};
  return pose;
}

TEST(BoardProjection, IsOpenCvsWithPixelCentresAtHalfIntegers) {
  BoardSet set = MakeBoardSet(LensVector::Zero(), 1, 0, 1);
  set.camera.k1 = 0.05, set.camera.p2 = 0.001;
  const BoardPose pose = SomePose();
  const cv::Mat lens =
      (cv::Mat_<double>(3, 3) << 540 * 1.03 * 1.01, 0, 320 + 4 - 0.5, 0, 540 * 1.03, 240 - 6 - 0.5, 0, 0, 1);
  const cv::Mat distortion = (cv::Mat_<double>(5, 1) << -0.25 + 0.05, 0.1, 0.004, -0.003 + 0.001, -0.05);
  const Eigen::AngleAxisd turn(pose.rotation);
  const Eigen::Vector3d w = turn.angle() * turn.axis();
  std::vector<cv::Point3d> points;
  for (int k = 0; k < set.board.corners(); ++k)
    points.emplace_back(set.board.CornerM(k).x(), set.board.CornerM(k).y(), 0);
  std::vector<cv::Point2d> theirs;
  cv::projectPoints(points, cv::Vec3d(w.x(), w.y(), w.z()),
                    cv::Vec3d(pose.translation_m.x(), pose.translation_m.y(), pose.translation_m.z()), lens,
                    distortion, theirs);
  for (int k = 0; k < set.board.corners(); ++k) {
    ProjectedCorner ours;
    ASSERT_TRUE(
        ProjectCorner(PhotoLensOf(CameraWith(set.camera, kAllEntries)), pose, set.board.CornerM(k), &ours));
    EXPECT_NEAR(ours.px.x(), theirs[k].x + 0.5, 1e-9);
    EXPECT_NEAR(ours.px.y(), theirs[k].y + 0.5, 1e-9);
  }
}

TEST(BoardProjection, DerivativesAreThoseOfFiniteDifferences) {
  const BoardSet set = MakeBoardSet(LensVector::Zero(), 1, 0, 1);
  const BoardPose pose = SomePose();
  const Eigen::Vector2d corner = set.board.CornerM(17);
  ProjectedCorner here, more, less;
  const image::PhotoLens lens = PhotoLensOf(CameraWith(set.camera, kAllEntries));
  ASSERT_TRUE(ProjectCorner(lens, pose, corner, &here));
  for (int entry = 0; entry < 6; ++entry) {
    const auto moved = [&](double by) {
      BoardPose other = pose;
      if (entry < 3)
        other.rotation =
            Eigen::AngleAxisd(by, Eigen::Vector3d::Unit(entry)).toRotationMatrix() * pose.rotation;
      else
        other.translation_m[entry - 3] += by;
      return other;
    };
    ASSERT_TRUE(ProjectCorner(lens, moved(1e-7), corner, &more));
    ASSERT_TRUE(ProjectCorner(lens, moved(-1e-7), corner, &less));
    EXPECT_LT((((more.px - less.px) / 2e-7) - here.by_pose.col(entry)).norm(), 1e-3) << entry;
  }
}

TEST(BoardProjection, RefusesWhatLiesBehindTheCamera) {
  const BoardSet set = MakeBoardSet(LensVector::Zero(), 1, 0, 1);
  BoardPose behind = SomePose();
  behind.translation_m.z() = -0.4;
  ProjectedCorner projected;
  EXPECT_FALSE(ProjectCorner(PhotoLensOf(set.camera), behind, {0, 0}, &projected));
}

TEST(BoardPose, UnseenCornersAreWorseThanFittedOnesByTheNoiseOfThePose) {
  const BoardSet set = MakeBoardSet(LensVector::Zero(), 40, 0.3, 4);
  const absl::StatusOr<std::vector<BoardPose>> poses = StartPoses(set, PhotoLensOf(set.camera));
  ASSERT_TRUE(poses.ok()) << poses.status();
  double seen = 0, unseen = 0;
  ProjectedCorner projected;
  for (int i = 0; i < 40; ++i) {
    for (int k = 0; k < set.board.corners(); ++k) {
      ASSERT_TRUE(ProjectCorner(PhotoLensOf(set.camera), (*poses)[i], set.board.CornerM(k), &projected));
      seen += (set.pictures[i].corners_px[k] - projected.px).squaredNorm();
    }
    unseen += UnseenSquares(set, PhotoLensOf(set.camera), i, (*poses)[i]);
  }
  // 108 readings of variance 0.09: 6 of them go into the pose; of 54 readings that were not fitted to, none.
  EXPECT_NEAR(seen / 40, 0.09 * 102, 0.09 * 6);
  EXPECT_GT(unseen / 40, 0.09 * 108);
  EXPECT_LT(unseen / 40, 0.09 * 130);
}

TEST(BoardPose, NamesAPictureWhoseCornersDetermineNone) {
  BoardSet set = MakeBoardSet(LensVector::Zero(), 2, 0, 5);
  for (int k = 0; k < set.board.corners(); ++k) set.pictures[1].corners_px[k] = {10.0 + k, 20.0 + k};
  const absl::StatusOr<std::vector<BoardPose>> poses = StartPoses(set, PhotoLensOf(set.camera));
  ASSERT_FALSE(poses.ok());
  EXPECT_NE(poses.status().message().find("1.png"), std::string::npos) << poses.status();
}

}  // namespace
}  // namespace touchstone::diagnosis::boards
