// The corners of a board in pictures, found by OpenCV.
#pragma once

#include <optional>
#include <string>

#include <absl/status/statusor.h>

#include "server/diagnosis/boards/board_set.h"

namespace touchstone::diagnosis::boards {

// A pinhole of as many pixels of focal length as the picture is wide (53 deg), through its middle: what is taken where
// nobody has said anything.
session::CameraIntrinsics GuessedCamera(int width_px, int height_px);

// Reads every PNG and JPEG file of a folder, in the order of their names. The camera: camera.yaml if the folder has one,
// else GuessedCamera. INVALID_ARGUMENT names a file that cannot be read, or is of another size than the first; NOT_FOUND:
// no picture; UNIMPLEMENTED: built without OpenCV.
absl::StatusOr<BoardSet> ReadBoardPictures(const std::string& folder, const BoardLayout& board);

// "9x6" with a square of so many millimetres. INVALID_ARGUMENT says what was expected.
absl::StatusOr<BoardLayout> ParseBoardLayout(const std::string& corners, double square_mm);

}  // namespace touchstone::diagnosis::boards
