// The corners of a board as rows of the engine: u and v of each, px, measured minus predicted. A picture is a group and a
// block; its pose is eliminated: every prediction fits it to the picture's corners, so that six rows of each picture say
// nothing of the lens (EliminatedValues).
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/boards/board_pose.h"
#include "server/diagnosis/engine/fit/observation_model.h"

namespace touchstone::diagnosis::boards {

class BoardRows : public engine::ObservationModel {
 public:
  // `set` must outlive it. The effects of `given` are part of the nominal lens. FAILED_PRECONDITION names a picture whose
  // corners determine no pose.
  static absl::StatusOr<std::unique_ptr<BoardRows>> Make(const BoardSet& set, model::Model given);

  int rows() const override { return pictures() * rows_per_picture(); }
  const std::vector<std::string>& groups() const override { return files_; }
  int FirstRowOfGroup(int group) const override { return group * rows_per_picture(); }
  int GroupOfRow(int row) const override { return row / rows_per_picture(); }
  int BlockOfRow(int row) const override { return GroupOfRow(row); }
  double TimeOfRow(int) const override { return 0; }  // a lens does not change

  // u and v of every corner, picture by picture.
  absl::StatusOr<std::vector<double>> Predict(const model::Model& model) const override;
  Eigen::VectorXd Residual(const std::vector<double>& predicted) const override;
  Eigen::VectorXd Change(const std::vector<double>& predicted,
                         const std::vector<double>& moved) const override;
  // UnseenSquares of the pictures that have these rows.
  std::optional<double> SquaresOfUnseen(const model::Model& model,
                                        const std::vector<int>& rows) const override;

  int EliminatedValues() const override { return 6 * pictures(); }
  // Without what a move of each picture's board would do, under the given lens.
  Eigen::MatrixXd WithoutEliminated(Eigen::MatrixXd noise) const override;

 private:
  BoardRows(const BoardSet& set, model::Model given) : set_(set), given_(std::move(given)) {}
  int pictures() const { return static_cast<int>(set_.pictures.size()); }
  int rows_per_picture() const { return 2 * set_.board.corners(); }
  image::PhotoLens LensOf(const model::Model& model) const;

  const BoardSet& set_;
  model::Model given_;
  std::vector<std::string> files_;
  Eigen::VectorXd measured_;
  std::vector<BoardPose> nominal_poses_;
};

}  // namespace touchstone::diagnosis::boards
