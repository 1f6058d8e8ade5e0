// The corners that are found, and the whole way from real pictures to a lens, beside OpenCV's own calibration.
#include "server/diagnosis/boards/board_pictures.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "server/base/test_folder.h"
#include "server/base/test_paths.h"
#include "server/base/test_tier.h"
#include "server/diagnosis/boards/board_diagnosis.h"
#include "server/diagnosis/boards/board_test_set.h"

namespace touchstone::diagnosis::boards {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

// OpenCV's chessboard pictures; TOUCHSTONE_CHESSBOARD names another folder of them.
std::string ChessboardFolder() {
  const char* other = std::getenv("TOUCHSTONE_CHESSBOARD");
  return other != nullptr ? other : SharedData() + "/camera/opencv_chessboard";
}

// A drawn chessboard as a pinhole sees it: every pixel's ray meets the board, four by four rays a pixel.
cv::Mat DrawBoard(const BoardLayout& board, const session::CameraIntrinsics& camera, const BoardPose& pose) {
  const Eigen::Vector3d normal = pose.rotation.col(2);
  cv::Mat picture(camera.height_px, camera.width_px, CV_8U);
  for (int row = 0; row < camera.height_px; ++row)
    for (int column = 0; column < camera.width_px; ++column) {
      int bright = 0;
      for (int k = 0; k < 16; ++k) {
        const Eigen::Vector3d ray((column + (k % 4 + 0.5) / 4 - camera.cx_px) / camera.fx_px,
                                  (row + (k / 4 + 0.5) / 4 - camera.cy_px) / camera.fy_px, 1);
        const Eigen::Vector3d place =
            pose.rotation.transpose() *
            (ray * normal.dot(pose.translation_m) / normal.dot(ray) - pose.translation_m);
        // Squares begin one before the first inner corner; white paper round them.
        const int x = static_cast<int>(std::floor(place.x() / board.square_m)) + 1;
        const int y = static_cast<int>(std::floor(place.y() / board.square_m)) + 1;
        const bool on_board = x >= 0 && y >= 0 && x <= board.columns && y <= board.rows;
        bright += !on_board || (x + y) % 2 == 1;
      }
      picture.at<uint8_t>(row, column) = static_cast<uint8_t>(20 + bright * 13);
    }
  cv::GaussianBlur(picture, picture, cv::Size(), 0.7);  // as lenses do
  return picture;
}

TEST(BoardPictures, CornersAreFoundWhereTheyWereDrawn) {
  const TestFolder folder;
  const BoardLayout board{9, 6, 0.025};
  session::CameraIntrinsics camera = GuessedCamera(640, 480);
  BoardPose pose;
  pose.rotation = Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, -1, 0.3).normalized()).toRotationMatrix();
  pose.translation_m = Eigen::Vector3d(0, 0, 0.42) - pose.rotation * Eigen::Vector3d(0.1, 0.0625, 0);
  cv::imwrite(folder.Path("b.png"), DrawBoard(board, camera, pose));
  cv::imwrite(folder.Path("a.png"), cv::Mat(480, 640, CV_8U, cv::Scalar(128)));
  const absl::StatusOr<BoardSet> set = ReadBoardPictures(folder.path(), board);
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_TRUE(set->camera_is_guess);
  EXPECT_THAT(set->without_board, testing::ElementsAre("a.png"));
  ASSERT_EQ(set->pictures.size(), 1u);
  // The finder may count from the other end of the board.
  double smallest = INFINITY;
  for (const bool turned : {false, true}) {
    double here = 0;
    for (int k = 0; k < board.corners(); ++k) {
      ProjectedCorner drawn;
      ASSERT_TRUE(ProjectCorner(PhotoLensOf(camera), pose,
                                board.CornerM(turned ? board.corners() - 1 - k : k), &drawn));
      here += (set->pictures[0].corners_px[k] - drawn.px).squaredNorm() / board.corners();
    }
    smallest = std::min(smallest, std::sqrt(here));
  }
  EXPECT_LT(smallest, 0.1);
}

TEST(BoardPictures, RefusalsSayWhatWasExpected) {
  const TestFolder folder;
  const BoardLayout board{9, 6, 0.025};
  EXPECT_THAT(std::string(ReadBoardPictures(folder.path(), board).status().message()),
              HasSubstr("holds no picture"));
  EXPECT_THAT(std::string(ReadBoardPictures(folder.Path("absent"), board).status().message()),
              HasSubstr("a folder of pictures was expected"));
  cv::imwrite(folder.Path("a.png"), cv::Mat(48, 64, CV_8U, cv::Scalar(9)));
  cv::imwrite(folder.Path("b.png"), cv::Mat(48, 32, CV_8U, cv::Scalar(9)));
  EXPECT_THAT(std::string(ReadBoardPictures(folder.path(), board).status().message()),
              HasSubstr("b.png: has 32 x 48 px"));
  std::ofstream(folder.Path("b.png")) << "no picture";
  EXPECT_THAT(std::string(ReadBoardPictures(folder.path(), board).status().message()),
              HasSubstr("b.png: cannot be read"));
  fs::remove(folder.Path("b.png"));
  std::ofstream(folder.Path("camera.yaml"))
      << "{width_px: 65, height_px: 48, fx_px: 9, fy_px: 9, cx_px: 9, cy_px: 9}";
  EXPECT_THAT(std::string(ReadBoardPictures(folder.path(), board).status().message()),
              HasSubstr("is of pictures of 65 x 48"));
  for (const char* wrong : {"9", "9x", "9x2", "x6", "9x6x1", "1000x6", "a"})
    EXPECT_FALSE(ParseBoardLayout(wrong, 25).ok()) << wrong;
  EXPECT_FALSE(ParseBoardLayout("9x6", 0).ok());
  EXPECT_FALSE(ParseBoardLayout("9x6", NAN).ok());
  ASSERT_TRUE(ParseBoardLayout("9x6", 25).ok());
}

struct OpenCvLens {
  cv::Mat matrix, distortion;
  double rmse = 0;
};

std::vector<cv::Point3f> PointsOf(const BoardLayout& board, int parity) {
  std::vector<cv::Point3f> points;
  for (int k = 0; k < board.corners(); ++k)
    if (parity < 0 || (k % board.columns + k / board.columns) % 2 == parity)
      points.emplace_back(board.CornerM(k).x(), board.CornerM(k).y(), 0);
  return points;
}

std::vector<cv::Point2f> CornersOf(const BoardSet& set, size_t picture, int parity) {
  std::vector<cv::Point2f> corners;
  for (int k = 0; k < set.board.corners(); ++k)
    if (parity < 0 || (k % set.board.columns + k / set.board.columns) % 2 == parity)
      corners.emplace_back(set.pictures[picture].corners_px[k].x() - 0.5,
                           set.pictures[picture].corners_px[k].y() - 0.5);
  return corners;
}

// OpenCV's own calibration with all that it has by default (fx, fy, cx, cy, k1, k2, p1, p2, k3), from the pictures but one.
OpenCvLens Calibrate(const BoardSet& set, size_t without) {
  std::vector<std::vector<cv::Point3f>> points;
  std::vector<std::vector<cv::Point2f>> corners;
  for (size_t i = 0; i < set.pictures.size(); ++i) {
    if (i == without) continue;
    points.push_back(PointsOf(set.board, -1));
    corners.push_back(CornersOf(set, i, -1));
  }
  OpenCvLens lens;
  std::vector<cv::Mat> turns, shifts;
  lens.rmse = cv::calibrateCamera(points, corners, cv::Size(set.camera.width_px, set.camera.height_px),
                                  lens.matrix, lens.distortion, turns, shifts);
  return lens;
}

// As UnseenSquares, by OpenCV's pose solver and projection.
double OpenCvUnseenSquares(const BoardSet& set, const OpenCvLens& lens, size_t picture) {
  double sum = 0;
  for (const int seen : {0, 1}) {
    cv::Mat turn, shift;
    cv::solvePnP(PointsOf(set.board, seen), CornersOf(set, picture, seen), lens.matrix, lens.distortion, turn,
                 shift);
    std::vector<cv::Point2f> expected;
    cv::projectPoints(PointsOf(set.board, 1 - seen), turn, shift, lens.matrix, lens.distortion, expected);
    const std::vector<cv::Point2f> corners = CornersOf(set, picture, 1 - seen);
    for (size_t k = 0; k < corners.size(); ++k) sum += std::pow(cv::norm(corners[k] - expected[k]), 2);
  }
  return sum;
}

// The only pictures here that a real camera took.
TEST(BoardPictures, RealPicturesNameRadialDistortionAndAgreeWithOpenCvsCalibration) {
  TOUCHSTONE_SECOND_TIER("long: corners of a set of large pictures");
  const std::string folder = ChessboardFolder();
  if (!fs::exists(folder)) GTEST_SKIP() << folder << " is not there: OpenCV's chessboard pictures are needed";
  const absl::StatusOr<BoardSet> set = ReadBoardPictures(folder, {9, 6, 0.025});
  ASSERT_TRUE(set.ok()) << set.status();
  ASSERT_EQ(set->pictures.size(), 13u);
  const absl::StatusOr<BoardDiagnosis> diagnosis = DiagnoseBoards(*set, model::NominalModel(), 0);
  ASSERT_TRUE(diagnosis.ok()) << diagnosis.status();
  const engine::LadderStep* radial = nullptr;
  for (const engine::LadderStep& step : diagnosis->steps)
    if (step.effect == "radial_distortion") radial = &step;
  ASSERT_NE(radial, nullptr) << diagnosis->summary;
  EXPECT_GT(radial->probability, 0.99);

  const OpenCvLens theirs = Calibrate(*set, set->pictures.size());
  const double their_k1 = theirs.distortion.at<double>(0);
  EXPECT_NEAR(radial->parameters[0].value, their_k1, 0.02);
  double their_squares = 0;
  for (size_t i = 0; i < set->pictures.size(); ++i)
    their_squares += OpenCvUnseenSquares(*set, Calibrate(*set, i), i);
  const double their_unseen = std::sqrt(their_squares / diagnosis->corners);
  EXPECT_LT(diagnosis->final->heldout_rmse, 1.05 * their_unseen);
  EXPECT_GT(diagnosis->initial->heldout_rmse, 3 * their_unseen);
  std::printf(
      "k1 %.4f +- %.4f, OpenCV %.4f; left-out pictures %.4f px before, %.4f after, OpenCV %.4f; all pictures "
      "%.4f, "
      "%.4f, OpenCV %.4f\n%s\n",
      radial->parameters[0].value, radial->parameters[0].std_error, their_k1,
      diagnosis->initial->heldout_rmse, diagnosis->final->heldout_rmse, their_unseen,
      diagnosis->initial->rmse, diagnosis->final->rmse, theirs.rmse, diagnosis->summary.c_str());
}

}  // namespace
}  // namespace touchstone::diagnosis::boards
