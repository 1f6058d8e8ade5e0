#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include "server/base/units.h"
#include "server/diagnosis/boards/board_pictures.h"

namespace touchstone::diagnosis::boards {

session::CameraIntrinsics GuessedCamera(int width_px, int height_px) {
  session::CameraIntrinsics camera;
  camera.width_px = width_px;
  camera.height_px = height_px;
  camera.fx_px = camera.fy_px = width_px;
  camera.cx_px = 0.5 * width_px;
  camera.cy_px = 0.5 * height_px;
  return camera;
}

absl::StatusOr<BoardLayout> ParseBoardLayout(const std::string& corners, double square_mm) {
  const std::vector<std::string> sides = absl::StrSplit(corners, 'x');
  BoardLayout board;
  if (sides.size() != 2 || !absl::SimpleAtoi(sides[0], &board.columns) ||
      !absl::SimpleAtoi(sides[1], &board.rows) || std::min(board.columns, board.rows) < 3 ||
      std::max(board.columns, board.rows) > 100)
    return absl::InvalidArgumentError(absl::StrCat(
        "--board: '", corners, "' is no number of inner corners; for instance 9x6, from 3x3 to 100x100"));
  if (!(square_mm >= 0.01 && square_mm <= 10000))
    return absl::InvalidArgumentError(
        absl::StrCat("--square-mm: ", square_mm, " is no side of a square; must be from 0.01 to 10000"));
  board.square_m = ToSi(Unit::kMillimetre, square_mm);
  return board;
}

}  // namespace touchstone::diagnosis::boards
