// One photograph of PhotoRows. Part of photo_rows.cpp and photo_view.cpp only.
#pragma once

#include <mutex>
#include <vector>

#include "server/diagnosis/images/rows/photo_rows.h"

namespace touchstone::diagnosis::images {

struct PhotoRows::View {
  int k = 0;
  Eigen::VectorXf weights;          // of the cells
  Eigen::MatrixXf basis;            // rows x cells
  Eigen::VectorXf cells_at_anchor;  // sums of the anchor's picture
  Eigen::VectorXd rows_at_anchor;   // of that picture
  Eigen::VectorXd measured;         // rows
  Eigen::MatrixXd slopes;           // rows x directions that move rays, per SI unit
  Eigen::MatrixXd field;            // rows x functions of the image field
  std::vector<engine::SmoothErrorSite> sites;
  mutable std::mutex mutex;  // of the workspace
  mutable image::PhotoWorkspace workspace;

  // Sets what is known of the anchor's picture; `weights` and `basis` are set.
  void SetAnchor(const CellGrid& grid, const std::vector<float>& grey);
  // Rows of a picture as it is recorded on average. Cells that are as in the anchor's cost nothing.
  Eigen::VectorXd Project(const CellGrid& grid, const std::vector<float>& grey) const;
};

// A way in which a picture may change.
struct PhotoRows::Direction {
  std::shared_ptr<const model::Effect> effect;
  int instance = 0;  // of the effect in `base`
  int value = -1;    // of its flat values, that alone moves; -1: several do
  double step = 0;   // of that value, SI
  double lower = 0, upper = 0;
  model::Model base;  // the anchor, with the effect where it lacks it
  model::Model moved;
};

}  // namespace touchstone::diagnosis::images
