// Fits a lens to pictures of a board: every picture's board has a pose of its own, which is always fitted along.
#pragma once

#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/boards/board_set.h"
#include "server/diagnosis/boards/lens_terms.h"

namespace touchstone::diagnosis::boards {

// The corners that take part in a fit.
enum class CornerHalf { kAll, kEven, kOdd };  // like the colours of a chessboard

struct BoardFit {
  LensVector lens = LensVector::Zero();
  std::vector<BoardPose> poses;  // of every picture of the set, fitted or not
  std::vector<double>
      squares_px2;     // by picture: sum over its corners of the squared distance; 0 if it has no weight
  double sum_px2 = 0;  // with the weights
};

// Poses from the homography of each picture, for a lens without distortion. FAILED_PRECONDITION names a picture whose
// corners determine none.
absl::StatusOr<BoardFit> StartFit(const BoardSet& set);

// Least squares from where `fit` stands: the entries of `free`, and the poses of pictures whose weight is not 0.
// Levenberg and Marquardt; the poses are eliminated picture by picture. `weights` empty: 1 each.
BoardFit FitBoards(const BoardSet& set, BoardFit fit, const std::vector<int>& free,
                   const std::vector<double>& weights = {});

// The sum of squares (px^2) of one half of the corners of a picture where its pose was fitted to the other half, both
// ways round: the error on corners that nothing was fitted to. The lens is as it is.
double UnseenSquares(const BoardSet& set, const BoardFit& fit, int picture);

}  // namespace touchstone::diagnosis::boards
