// Photographs as the engine sees them: a few dozen rows each, objects as groups, poses as blocks.
//
// A row is the picture's cells (photo_cells.h) along one of a few dozen orthonormal directions: what every effect that
// may be missing does to the picture, smooth light over the picture and the object, smooth displacements. Of white
// pixel noise the rows are independent and of unit variance, whatever the directions. They are made at an anchor, a
// model that is near enough; predictions are exact everywhere, only derivatives by what moves the rays are the anchor's.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/diagnosis/engine/fit/observation_model.h"
#include "server/diagnosis/engine/fit/smooth_error.h"
#include "server/diagnosis/images/photographs.h"
#include "server/diagnosis/images/pixels/photo_cells.h"

namespace touchstone::diagnosis::images {

// Whether photographs show what the effect changes on average.
bool ShowsInPhotographs(const model::Effect& effect);
// Whether it moves what pixels look at, which costs rays.
bool MovesRays(const model::Effect& effect);

struct PhotoRowsOptions {
  int cells = 12544;                      // of a picture, at most
  int smoothing = 1;                      // passes over the directions
  int max_photographs = 40;               // that the search sees
  double contour_px2 = kUnknownPlacePx2;  // variance of a contour's place
  int max_trial_steps = 0;                // engine::SearchRules
  int max_steps = 6;                      // the same
};

class PhotoRows : public engine::ObservationModel {
 public:
  // `photographs` must outlive it. `effects`: that may be missing; those of the anchor are added. Errors: what the
  // simulator says of the anchor.
  static absl::StatusOr<std::unique_ptr<PhotoRows>> Make(
      const Photographs& photographs, const model::Model& anchor,
      const std::vector<std::shared_ptr<const model::Effect>>& effects, const PhotoRowsOptions& options,
      ThreadPool* pool);

  ~PhotoRows() override;

  int rows() const override { return first_row_.back(); }
  const std::vector<std::string>& groups() const override { return photographs_.objects; }
  int FirstRowOfGroup(int group) const override { return first_row_of_group_[group]; }
  int GroupOfRow(int row) const override { return photographs_.object[PhotographOfRow(row)]; }
  int BlockOfRow(int row) const override { return photographs_.pose[PhotographOfRow(row)]; }
  double TimeOfRow(int row) const override { return photographs_.TimeOf(PhotographOfRow(row)); }
  // What cannot be simulated is far from everything that was measured.
  absl::StatusOr<std::vector<double>> Predict(const model::Model& model) const override;
  absl::StatusOr<std::vector<double>> PredictNear(const model::Model& moved, const model::Model& at,
                                                  const std::vector<double>& predicted) const override;
  absl::StatusOr<std::vector<double>> PredictOthers(const model::Model& model,
                                                    const std::vector<int>& unread) const override;
  absl::StatusOr<std::vector<double>> PredictOthersNear(const model::Model& moved, const model::Model& at,
                                                        const std::vector<double>& predicted,
                                                        const std::vector<int>& unread) const override;
  absl::StatusOr<std::vector<double>> CompletePrediction(const model::Model& model,
                                                         const std::vector<double>&) const override {
    return Predict(model);
  }
  Eigen::VectorXd Residual(const std::vector<double>& predicted) const override;
  Eigen::VectorXd Change(const std::vector<double>& predicted,
                         const std::vector<double>& moved) const override;
  double DerivativeStep() const override { return 0.25; }
  bool HasRoughDerivatives(const model::Effect& effect) const override { return MovesRays(effect); }

  // Where a smooth error of the objects' albedo enters: a share h of the light of a place.
  const engine::SmoothErrorGeometry& albedo() const { return albedo_; }
  int PhotographOfRow(int row) const { return photograph_of_row_[row]; }
  int photographs() const { return static_cast<int>(views_.size()); }

 private:
  struct View;
  struct Direction;
  PhotoRows(const Photographs& photographs, ThreadPool* pool);

  void Choose(int max_photographs);
  static std::vector<Direction> DirectionsOf(
      const model::Model& anchor, const std::vector<std::shared_ptr<const model::Effect>>& effects);
  absl::Status MakeView(const model::Model& anchor, const std::vector<Direction>& directions,
                        const PhotoRowsOptions& options, View* view) const;
  void Number(const std::vector<Direction>& directions);
  // Rows of one view, without the image field.
  Eigen::VectorXd Expect(const image::PhotoSimulator& simulator, const View& view) const;
  // Of photographs without any row that is read, zeros.
  std::vector<double> Predict(const model::Model& model, const std::vector<int>& unread,
                              ThreadPool* pool) const;

  const Photographs& photographs_;
  ThreadPool* pool_;
  CellGrid grid_;
  Eigen::MatrixXf field_cells_;  // functions of the image field, summed over cells: the same of every view
  std::vector<std::unique_ptr<View>> views_;
  std::vector<int> first_row_, first_row_of_group_, photograph_of_row_;
  std::map<std::pair<std::string, int>, int> slope_of_;  // (effect, value) -> column of the views' slopes
  Eigen::VectorXd measured_;
  engine::SmoothErrorGeometry albedo_;

  mutable std::mutex mutex_;
  mutable std::map<std::string, std::shared_ptr<const std::vector<double>>> known_;  // rows of one object
};

}  // namespace touchstone::diagnosis::images
