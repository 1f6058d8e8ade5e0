// Pictures of a flat board whose corners' places on it are known: what a lens is measured with.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "server/session/images/image_set.h"

namespace touchstone::diagnosis::boards {

// A chessboard by its inner corners, where four squares meet.
struct BoardLayout {
  int columns = 0, rows = 0;
  double square_m = 0;

  int corners() const { return columns * rows; }
  // In the board's plane, row by row.
  Eigen::Vector2d CornerM(int corner) const {
    return square_m * Eigen::Vector2d(corner % columns, corner / columns);
  }
};

struct BoardPicture {
  std::string file;
  std::vector<Eigen::Vector2d> corners_px;  // as BoardLayout counts them; pixel centres lie at half-integers
};

struct BoardSet {
  std::string origin;  // the folder
  BoardLayout board;
  session::CameraIntrinsics camera;  // nominal
  bool camera_is_guess = false;      // no camera.yaml: see GuessedCamera
  std::vector<BoardPicture> pictures;
  std::vector<std::string> without_board;  // files in which no whole board was found
};

}  // namespace touchstone::diagnosis::boards
