// One photograph of PhotoRows. Part of photo_rows.cpp and photo_view.cpp only.
#pragma once

#include <mutex>
#include <vector>

#include "server/diagnosis/images/photo_rows.h"

namespace touchstone::diagnosis::images {

struct PhotoRows::View {
  int k = 0;
  Eigen::VectorXf weights;   // of the cells
  Eigen::MatrixXf basis;     // cells x rows
  Eigen::VectorXd measured;  // rows
  Eigen::MatrixXd slopes;    // rows x directions that move rays, per SI unit
  Eigen::MatrixXd field;     // rows x functions of the image field
  std::vector<engine::SmoothErrorSite> sites;
  mutable std::mutex mutex;  // of the workspace
  mutable image::PhotoWorkspace workspace;

  Eigen::VectorXd Project(const CellGrid& grid, const std::vector<float>& grey) const {
    return (basis.transpose() * CellSums(grid, grey.data(), weights)).cast<double>();
  }
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

// What is recorded on average where this photo is expected.
std::vector<float> RecordedGrey(const image::Photo& photo, const RecordTable& record);

}  // namespace touchstone::diagnosis::images
