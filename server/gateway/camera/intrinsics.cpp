#include <cmath>
#include <filesystem>

#include <absl/strings/str_cat.h>
#include <opencv2/core.hpp>

#include "server/base/status.h"
#include "server/gateway/camera/camera_kinds.h"

namespace touchstone::gateway::camera {
namespace {

// Under one of the names that OpenCV's tools have used.
cv::FileNode Find(const cv::FileStorage& file, std::initializer_list<const char*> names) {
  for (const char* name : names)
    if (cv::FileNode node = file[name]; !node.empty()) return node;
  return cv::FileNode();
}

absl::StatusOr<cv::Mat> ReadMatrix(const cv::FileNode& node, const std::string& place) {
  cv::Mat matrix;
  if (!node.empty() && node.isMap()) node >> matrix;
  if (matrix.empty() || matrix.channels() != 1)
    return absl::InvalidArgumentError(absl::StrCat(place, " is missing or no matrix of OpenCV"));
  cv::Mat doubles;
  matrix.convertTo(doubles, CV_64F);
  for (int i = 0; i < doubles.rows; ++i)
    for (int j = 0; j < doubles.cols; ++j)
      if (!std::isfinite(doubles.at<double>(i, j)))
        return absl::InvalidArgumentError(absl::StrCat(place, "[", i, ", ", j, "] is not finite"));
  return doubles;
}

absl::StatusOr<image::Intrinsics> Read(const std::string& path) {
  const cv::FileStorage file(path, cv::FileStorage::READ);
  if (!file.isOpened())
    return absl::InvalidArgumentError(absl::StrCat(path, ": neither YAML nor XML of OpenCV"));
  image::Intrinsics intrinsics;
  for (const auto& [name, old_name, value] :
       {std::tuple<const char*, const char*, int*>{"image_width", "image_Width", &intrinsics.width},
        {"image_height", "image_Height", &intrinsics.height}}) {
    const cv::FileNode node = Find(file, {name, old_name});
    if (node.empty() || !node.isInt() || static_cast<int>(node) < 1)
      return absl::InvalidArgumentError(
          absl::StrCat(path, ": ", name, " is missing or no whole number above 0"));
    *value = static_cast<int>(node);
  }

  TOUCHSTONE_ASSIGN_OR_RETURN(const cv::Mat matrix, ReadMatrix(Find(file, {"camera_matrix", "Camera_Matrix"}),
                                                               absl::StrCat(path, ": camera_matrix")));
  if (matrix.rows != 3 || matrix.cols != 3)
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": camera_matrix is ", matrix.rows, " x ", matrix.cols, "; right is 3 x 3"));
  intrinsics.fx_px = matrix.at<double>(0, 0);
  intrinsics.fy_px = matrix.at<double>(1, 1);
  intrinsics.cx_px = matrix.at<double>(0, 2);
  intrinsics.cy_px = matrix.at<double>(1, 2);
  if (intrinsics.fx_px <= 0 || intrinsics.fy_px <= 0)
    return absl::InvalidArgumentError(absl::StrCat(path, ": camera_matrix: focal lengths ", intrinsics.fx_px,
                                                   " and ", intrinsics.fy_px, " px; right is above 0"));
  if (matrix.at<double>(0, 1) != 0)
    return absl::InvalidArgumentError(absl::StrCat(path, ": camera_matrix[0, 1] is ", matrix.at<double>(0, 1),
                                                   "; a skew is not supported"));

  const cv::FileNode node = Find(file, {"distortion_coefficients", "Distortion_Coefficients"});
  if (node.empty()) return intrinsics;
  const std::string place = absl::StrCat(path, ": distortion_coefficients");
  TOUCHSTONE_ASSIGN_OR_RETURN(const cv::Mat distortion, ReadMatrix(node, place));
  const size_t count = distortion.total();
  if ((distortion.rows != 1 && distortion.cols != 1) ||
      (count != 4 && count != 5 && count != 8 && count != 12 && count != 14))
    return absl::InvalidArgumentError(absl::StrCat(place, ": ", distortion.rows, " x ", distortion.cols,
                                                   "; right are 4, 5, 8, 12 or 14 numbers"));
  intrinsics.distortion.assign(distortion.begin<double>(), distortion.end<double>());
  return intrinsics;
}

}  // namespace

absl::StatusOr<image::Intrinsics> ReadIntrinsics(const std::string& path) {
  QuietOpenCv();
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error))
    return absl::NotFoundError(absl::StrCat("intrinsics: there is no file ", path));
  try {
    return Read(path);
  } catch (const cv::Exception& problem) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": ", problem.err));
  }
}

}  // namespace touchstone::gateway::camera
