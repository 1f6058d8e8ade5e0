#include "server/diagnosis/boards/board_pictures.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/diagnosis/boards/rules.h"
#include "server/image/encoding/whole_picture.h"
#include "server/session/images/camera_yaml.h"
#include "server/session/images/image_set_file.h"

namespace touchstone::diagnosis::boards {
namespace {

namespace fs = std::filesystem;

absl::StatusOr<std::vector<fs::path>> PicturesOf(const std::string& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string extension = absl::AsciiStrToLower(entry.path().extension().string());
    if (extension == ".png" || extension == ".jpg" || extension == ".jpeg") files.push_back(entry.path());
  }
  if (error)
    return absl::NotFoundError(
        absl::StrCat(folder, ": ", error.message(), "; a folder of pictures was expected"));
  if (files.empty()) return absl::NotFoundError(absl::StrCat(folder, ": holds no picture (.png, .jpg)"));
  if (files.size() > kBoardRules.max_pictures)
    return absl::InvalidArgumentError(absl::StrCat(
        folder, ": holds ", files.size(), " pictures; must be at most ", kBoardRules.max_pictures.value()));
  std::sort(files.begin(), files.end());
  return files;
}

double SmallestStep(const std::vector<cv::Point2f>& corners, const BoardLayout& board) {
  double smallest = INFINITY;
  for (int k = 0; k < board.corners(); ++k) {
    if (k % board.columns + 1 < board.columns)
      smallest = std::min(smallest, cv::norm(corners[k + 1] - corners[k]));
    if (k + board.columns < board.corners())
      smallest = std::min(smallest, cv::norm(corners[k + board.columns] - corners[k]));
  }
  return smallest;
}

// None: the whole board is not in the picture.
std::optional<BoardPicture> FindCorners(const cv::Mat& grey, const BoardLayout& board,
                                        const std::string& file) {
  std::vector<cv::Point2f> corners;
  if (!cv::findChessboardCorners(grey, cv::Size(board.columns, board.rows), corners) ||
      static_cast<int>(corners.size()) != board.corners())
    return std::nullopt;
  const int window = std::clamp(static_cast<int>(kBoardRules.window_share * SmallestStep(corners, board)),
                                kBoardRules.min_window_px.value(), kBoardRules.max_window_px.value());
  cv::cornerSubPix(grey, corners, cv::Size(window, window), cv::Size(-1, -1),
                   cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 40, 1e-3));
  BoardPicture picture;
  picture.file = file;
  // OpenCV's pixel centres are whole numbers.
  for (const cv::Point2f& corner : corners) picture.corners_px.emplace_back(corner.x + 0.5, corner.y + 0.5);
  return picture;
}

absl::Status ReadCamera(const fs::path& file, BoardSet* set) {
  std::ifstream stream(file, std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(stream)), {});
  if (!stream.good() && !stream.eof())
    return absl::InvalidArgumentError(absl::StrCat(file.string(), ": cannot be read"));
  const session::CameraIntrinsics guessed = set->camera;
  TOUCHSTONE_ASSIGN_OR_RETURN(set->camera, session::ParseCameraYaml(text, file.string()));
  if (set->camera.width_px != guessed.width_px || set->camera.height_px != guessed.height_px)
    return absl::InvalidArgumentError(absl::StrCat(
        file.string(), ": is of pictures of ", set->camera.width_px, " x ", set->camera.height_px,
        " px, but those of the folder have ", guessed.width_px, " x ", guessed.height_px));
  set->camera_is_guess = false;
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<BoardSet> ReadBoardPictures(const std::string& folder, const BoardLayout& board) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<fs::path> files, PicturesOf(folder));
  BoardSet set;
  set.origin = folder;
  set.board = board;
  set.camera_is_guess = true;
  for (const fs::path& file : files) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(file.string(), session::kMaxPictureBytes));
    if (const absl::Status whole = image::CheckWholePicture(bytes); !whole.ok())
      return absl::Status(whole.code(), absl::StrCat(file.string(), ": cannot be read: ", whole.message()));
    try {
      const cv::Mat coded(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
      const cv::Mat grey = cv::imdecode(coded, cv::IMREAD_GRAYSCALE);
      if (grey.empty() || std::max(grey.cols, grey.rows) > kBoardRules.max_side_px)
        return absl::InvalidArgumentError(absl::StrCat(file.string(),
                                                       ": cannot be read as a picture of at most ",
                                                       kBoardRules.max_side_px.value(), " px a side"));
      if (set.camera.width_px == 0) set.camera = GuessedCamera(grey.cols, grey.rows);
      if (grey.cols != set.camera.width_px || grey.rows != set.camera.height_px)
        return absl::InvalidArgumentError(absl::StrCat(
            file.string(), ": has ", grey.cols, " x ", grey.rows, " px, those before it ",
            set.camera.width_px, " x ", set.camera.height_px, "; pictures of one camera were expected"));
      std::optional<BoardPicture> picture = FindCorners(grey, board, file.filename().string());
      if (picture.has_value())
        set.pictures.push_back(*std::move(picture));
      else
        set.without_board.push_back(file.filename().string());
    } catch (const cv::Exception& error) {
      return absl::InvalidArgumentError(absl::StrCat(file.string(), ": OpenCV: ", error.what()));
    }
  }
  const fs::path camera = fs::path(folder) / "camera.yaml";
  std::error_code error;
  if (fs::exists(camera, error)) TOUCHSTONE_RETURN_IF_ERROR(ReadCamera(camera, &set));
  return set;
}

}  // namespace touchstone::diagnosis::boards
