// In place of board_pictures.cpp where the build has no OpenCV.
#include "server/diagnosis/boards/board_pictures.h"

namespace touchstone::diagnosis::boards {

absl::StatusOr<BoardSet> ReadBoardPictures(const std::string& folder, const BoardLayout& board) {
  return absl::UnimplementedError(
      "this build has no OpenCV, which finds the corners of a board; build with -DTOUCHSTONE_CAMERA=ON");
}

}  // namespace touchstone::diagnosis::boards
