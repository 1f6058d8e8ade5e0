#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Dense>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "server/base/test_paths.h"
#include "server/base/test_tier.h"
#include "server/gateway/camera/camera.h"

namespace touchstone::gateway::camera {
namespace {

using testing::HasSubstr;

std::string WriteText(const std::string& name, const std::string& text) {
  const std::string path = testing::TempDir() + "/touchstone_" + name;
  std::ofstream(path) << text;
  return path;
}

constexpr char kHead[] = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n";
constexpr char kMatrix[] =
    "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data: [ 500., 0., 320., 0., 510., 240., 0., 0., 1. ]\n";

std::string ErrorOf(const std::string& text) {
  const std::string path = WriteText("bad.yml", text);
  const absl::StatusOr<image::Intrinsics> intrinsics = ReadIntrinsics(path);
  std::filesystem::remove(path);
  EXPECT_FALSE(intrinsics.ok());
  EXPECT_THAT(std::string(intrinsics.status().message()), HasSubstr("bad.yml"));
  return std::string(intrinsics.status().message());
}

TEST(Intrinsics, AreReadAsOpenCvWritesThem) {
  for (const char* extension : {"yml", "xml"}) {
    const std::string path = testing::TempDir() + "/touchstone_intrinsics." + extension;
    {
      cv::FileStorage file(path, cv::FileStorage::WRITE);
      file << "image_width" << 640 << "image_height" << 480;
      file << "camera_matrix" << cv::Mat(cv::Matx33d(500, 0, 320.5, 0, 510, 240.25, 0, 0, 1));
      file << "distortion_coefficients" << cv::Mat(cv::Matx<double, 5, 1>(-0.3, 0.1, 0.001, 0.002, -0.05));
    }
    const absl::StatusOr<image::Intrinsics> intrinsics = ReadIntrinsics(path);
    std::filesystem::remove(path);
    ASSERT_TRUE(intrinsics.ok()) << intrinsics.status();
    EXPECT_EQ(intrinsics->width, 640);
    EXPECT_EQ(intrinsics->height, 480);
    EXPECT_EQ(intrinsics->fx_px, 500);
    EXPECT_EQ(intrinsics->fy_px, 510);
    EXPECT_EQ(intrinsics->cx_px, 320.5);
    EXPECT_EQ(intrinsics->cy_px, 240.25);
    EXPECT_THAT(intrinsics->distortion, testing::ElementsAre(-0.3, 0.1, 0.001, 0.002, -0.05));
  }
}

TEST(Intrinsics, ErrorsNameTheFileAndTheField) {
  const std::string head = kHead, matrix = kMatrix;
  EXPECT_THAT(std::string(ReadIntrinsics("no/such.yml").status().message()), HasSubstr("no/such.yml"));
  EXPECT_THAT(ErrorOf("%YAML:1.0\n---\nimage_height: 480\n" + matrix), HasSubstr("image_width"));
  EXPECT_THAT(ErrorOf(head), HasSubstr("camera_matrix"));
  EXPECT_THAT(ErrorOf(head + "camera_matrix: 7\n"), HasSubstr("camera_matrix"));
  EXPECT_THAT(
      ErrorOf(head + "camera_matrix: !!opencv-matrix\n   rows: 1\n   cols: 2\n   dt: d\n   data: [1., 2.]\n"),
      HasSubstr("camera_matrix is 1 x 2; right is 3 x 3"));
  EXPECT_THAT(ErrorOf(head + matrix +
                      "distortion_coefficients: !!opencv-matrix\n   rows: 3\n   cols: 1\n   dt: d\n   data: "
                      "[1., 2., 3.]\n"),
              HasSubstr("right are 4, 5, 8, 12 or 14"));
  EXPECT_THAT(ErrorOf("{ this is: [ no file of OpenCV"), HasSubstr("bad.yml"));
}

// A picture of vertical stripes one column each: its value is its column.
image::Frame Columns(int width, int height) {
  image::Frame frame;
  frame.width = width;
  frame.height = height;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c) frame.rgb.push_back(static_cast<uint8_t>(c == 0 ? x + 1 : 100 + c));
  return frame;
}

TEST(Rectify, KeepsAPictureThatIsRightAlready) {
  const image::Frame frame = Columns(200, 150);
  EXPECT_EQ(Rectify(frame, image::Intrinsics(), 200, 150, 0.8, false), frame.rgb);
}

TEST(Rectify, BlackensWhatTheCameraDidNotSee) {
  const image::Frame frame = Columns(100, 100);
  // Twice the tangent of the field of view: half of the picture each way is beyond the camera's.
  image::Intrinsics intrinsics;
  intrinsics.width = intrinsics.height = 100;
  intrinsics.fx_px = intrinsics.fy_px = 100;
  intrinsics.cx_px = intrinsics.cy_px = 49.5;
  const std::vector<uint8_t> grey = Rectify(frame, intrinsics, 100, 100, 2 * std::atan(1.0), true);
  ASSERT_EQ(grey.size(), 10000u);
  EXPECT_EQ(grey[100 * 50 + 20], 0);
  EXPECT_EQ(grey[100 * 20 + 50], 0);
  EXPECT_GT(grey[100 * 50 + 50], 50);
  EXPECT_GT(grey[100 * 28 + 50], 50);
}

TEST(Rectify, ScalesIntrinsicsToTheFramesSize) {
  image::Intrinsics intrinsics;  // of pictures twice as large
  intrinsics.width = 400;
  intrinsics.height = 300;
  intrinsics.fx_px = intrinsics.fy_px = 300 / (2 * std::tan(0.4));
  intrinsics.cx_px = 199.5;
  intrinsics.cy_px = 149.5;
  const image::Frame frame = Columns(200, 150);
  EXPECT_EQ(Rectify(frame, intrinsics, 200, 150, 0.8, false), frame.rgb);
}

TEST(Rectify, FoldsNothingBackIntoThePicture) {
  image::Intrinsics intrinsics;
  intrinsics.width = intrinsics.height = 100;
  intrinsics.fx_px = intrinsics.fy_px = 100;
  intrinsics.cx_px = intrinsics.cy_px = 49.5;
  intrinsics.distortion = {-0.3, 0, 0, 0};  // grows up to r = 1.054, and is back at 0.5 at 1.5
  const std::vector<uint8_t> grey =
      Rectify(Columns(100, 100), intrinsics, 101, 101, 2 * std::atan(1.6), true);
  EXPECT_EQ(grey[101 * 50], 0) << "at r = 1.6";
  EXPECT_EQ(grey[101 * 50 + 3], 0) << "at r = 1.5";
  EXPECT_GT(grey[101 * 50 + 50], 50);
}

// How far the corners of each row and column of the board lie from the straight line through them,
// root mean square.
double Crookedness(const std::vector<cv::Point2f>& corners, int columns, int rows) {
  double squares = 0;
  int count = 0;
  const auto line = [&](const std::vector<cv::Point2f>& points) {
    Eigen::MatrixXd p(points.size(), 2);
    for (size_t i = 0; i < points.size(); ++i) p.row(i) << points[i].x, points[i].y;
    p.rowwise() -= p.colwise().mean().eval();
    squares += std::pow(Eigen::JacobiSVD<Eigen::MatrixXd>(p).singularValues()(1), 2);
    count += static_cast<int>(points.size());
  };
  for (int r = 0; r < rows; ++r)
    line(std::vector<cv::Point2f>(corners.begin() + r * columns, corners.begin() + (r + 1) * columns));
  for (int c = 0; c < columns; ++c) {
    std::vector<cv::Point2f> points;
    for (int r = 0; r < rows; ++r) points.push_back(corners[r * columns + c]);
    line(points);
  }
  return std::sqrt(squares / count);
}

bool FindCorners(const cv::Mat& grey, const cv::Size& board, std::vector<cv::Point2f>* corners) {
  if (!cv::findChessboardCorners(grey, board, *corners)) return false;
  cv::cornerSubPix(grey, *corners, cv::Size(5, 5), cv::Size(-1, -1),
                   cv::TermCriteria(cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 30, 0.01));
  return true;
}

TEST(Rectify, StraightensTheRowsOfARealChessboard) {
  TOUCHSTONE_SECOND_TIER("long: corners of large pictures");
  const std::string folder = SharedData() + "/camera/opencv_chessboard";
  if (!std::filesystem::is_directory(folder)) GTEST_SKIP() << folder << " is missing";
  const cv::Size board(9, 6);
  std::vector<cv::Point3f> flat;
  for (int y = 0; y < board.height; ++y)
    for (int x = 0; x < board.width; ++x) flat.emplace_back(x * 0.025f, y * 0.025f, 0.0f);
  std::vector<std::string> paths;
  std::vector<std::vector<cv::Point2f>> corners;
  cv::Size size;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const cv::Mat grey = cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE);
    std::vector<cv::Point2f> found;
    if (grey.empty() || !FindCorners(grey, board, &found)) continue;
    size = grey.size();
    corners.push_back(found);
    paths.push_back(entry.path().string());
  }
  ASSERT_GE(corners.size(), 10u);
  cv::Mat matrix, distortion;
  std::vector<cv::Mat> rotations, translations;
  cv::calibrateCamera(std::vector<std::vector<cv::Point3f>>(corners.size(), flat), corners, size, matrix,
                      distortion, rotations, translations);
  image::Intrinsics intrinsics;
  intrinsics.width = size.width;
  intrinsics.height = size.height;
  intrinsics.fx_px = matrix.at<double>(0, 0);
  intrinsics.fy_px = matrix.at<double>(1, 1);
  intrinsics.cx_px = matrix.at<double>(0, 2);
  intrinsics.cy_px = matrix.at<double>(1, 2);
  intrinsics.distortion.assign(distortion.begin<double>(), distortion.end<double>());
  EXPECT_NEAR(intrinsics.distortion.at(0), -0.27, 0.03);

  double before = 0, after = 0;
  int seen = 0;
  for (size_t i = 0; i < paths.size(); ++i) {
    cv::Mat picture = cv::imread(paths[i]);
    cv::cvtColor(picture, picture, cv::COLOR_BGR2RGB);
    image::Frame frame;
    frame.width = picture.cols;
    frame.height = picture.rows;
    frame.rgb.assign(picture.data, picture.data + picture.total() * 3);
    const double fov_rad = 2 * std::atan(0.5 * size.height / intrinsics.fy_px);
    std::vector<uint8_t> straight = Rectify(frame, intrinsics, size.width, size.height, fov_rad, true);
    std::vector<cv::Point2f> found;
    if (!FindCorners(cv::Mat(size.height, size.width, CV_8UC1, straight.data()), board, &found)) continue;
    before += std::pow(Crookedness(corners[i], board.width, board.height), 2);
    after += std::pow(Crookedness(found, board.width, board.height), 2);
    ++seen;
  }
  ASSERT_GE(seen, 8);
  before = std::sqrt(before / seen);
  after = std::sqrt(after / seen);
  RecordProperty("crooked_before_um", static_cast<int>(before * 1000));
  RecordProperty("crooked_after_um", static_cast<int>(after * 1000));
  EXPECT_GT(before, 0.5);
  EXPECT_LT(after, 0.3 * before) << before << " px before";
}

}  // namespace
}  // namespace touchstone::gateway::camera
