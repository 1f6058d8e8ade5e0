// What a small motion of the object changes of a touch.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::selection {

inline constexpr int kPoseValues = 6;

// Whether every finger of touch k has a residual [k * fingers + i] and a contact whose place is a function of the pose: beyond
// touches::kTouchRules.min_cosine of incidence it is none.
bool HasPoseColumns(const touches::Observations& observations, const touches::Prediction& details,
                    const std::vector<double>& residuals, int k);

// Whether the details that pose columns are made of are there, one for each residual.
bool HasPoseDetails(const touches::Prediction& details, const std::vector<double>& residuals);

// Takes the mean over the touches of each pose from rows of any columns, `fingers` for each touch; `pose` [touch]. Returns how many
// touches are repeats.
int CentrePoses(const std::vector<int>& pose, int fingers, Eigen::MatrixXd* rows);

// Changes of the fingers' times, s, less their mean, fingers x kPoseValues: a plane through the contact that moves by m
// changes the travel by n.m / n.a. Columns: translation along x, y, z, s/m, rotation about x, y, z, s/rad; object frame.
Eigen::MatrixXd PoseColumns(const touches::Observations& observations, const touches::Prediction& details,
                            int k);

}  // namespace touchstone::diagnosis::selection
