#include "server/diagnosis/boards/board_rows.h"

#include <set>

#include "server/base/numbers/decompositions.h"
#include "server/base/status.h"

namespace touchstone::diagnosis::boards {
namespace {

using MapOfVector = Eigen::Map<const Eigen::VectorXd>;

}  // namespace

absl::StatusOr<std::unique_ptr<BoardRows>> BoardRows::Make(const BoardSet& set, model::Model given) {
  std::unique_ptr<BoardRows> rows(new BoardRows(set, std::move(given)));
  TOUCHSTONE_ASSIGN_OR_RETURN(rows->nominal_poses_, StartPoses(set, LensOfModel(set.camera, rows->given_)));
  for (int picture = 0; picture < rows->pictures(); ++picture)
    rows->files_.push_back(set.pictures[picture].file);
  rows->measured_.resize(rows->rows());
  for (int row = 0; row < rows->rows(); row += 2)
    rows->measured_.segment<2>(row) =
        set.pictures[rows->GroupOfRow(row)].corners_px[row % rows->rows_per_picture() / 2];
  return rows;
}

image::PhotoLens BoardRows::LensOf(const model::Model& model) const {
  return LensOfModel(set_.camera, WithEffectsOf(given_, model));
}

absl::StatusOr<std::vector<double>> BoardRows::Predict(const model::Model& model) const {
  const image::PhotoLens lens = LensOf(model);
  std::vector<double> predicted;
  ProjectedCorner projected;
  for (int picture = 0; picture < pictures(); ++picture) {
    const BoardPose pose = FitPose(set_, lens, picture, nominal_poses_[picture]);
    for (int corner = 0; corner < set_.board.corners(); ++corner) {
      ProjectCorner(lens, pose, set_.board.CornerM(corner), &projected);
      predicted.insert(predicted.end(), projected.px.begin(), projected.px.end());
    }
  }
  return predicted;
}

Eigen::VectorXd BoardRows::Residual(const std::vector<double>& predicted) const {
  return measured_ - MapOfVector(predicted.data(), rows());
}

Eigen::VectorXd BoardRows::Change(const std::vector<double>& predicted,
                                  const std::vector<double>& moved) const {
  return MapOfVector(moved.data(), rows()) - MapOfVector(predicted.data(), rows());
}

std::optional<double> BoardRows::SquaresOfUnseen(const model::Model& model,
                                                 const std::vector<int>& rows) const {
  std::set<int> unseen;
  for (const int row : rows) unseen.insert(GroupOfRow(row));
  const image::PhotoLens lens = LensOf(model);
  double sum = 0;
  for (const int picture : unseen) sum += UnseenSquares(set_, lens, picture, nominal_poses_[picture]);
  return sum;
}

Eigen::MatrixXd BoardRows::WithoutEliminated(Eigen::MatrixXd noise) const {
  const image::PhotoLens lens = LensOfModel(set_.camera, given_);
  ProjectedCorner projected;
  for (int picture = 0; picture < pictures(); ++picture) {
    const BoardPose pose = FitPose(set_, lens, picture, nominal_poses_[picture]);
    Eigen::MatrixXd by_pose = Eigen::MatrixXd::Zero(rows_per_picture(), 6);
    for (int corner = 0; corner < set_.board.corners(); ++corner)
      if (ProjectCorner(lens, pose, set_.board.CornerM(corner), &projected))
        by_pose.middleRows<2>(2 * corner) = projected.by_pose;
    auto own = noise.middleRows(FirstRowOfGroup(picture), rows_per_picture());
    own -= by_pose * SolveLeastSquaresColumns(by_pose, own);
  }
  return noise;
}

}  // namespace touchstone::diagnosis::boards
