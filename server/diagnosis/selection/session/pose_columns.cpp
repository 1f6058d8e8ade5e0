#include "server/diagnosis/selection/session/pose_columns.h"

#include <cmath>
#include <map>

#include "server/diagnosis/touches/rules.h"

namespace touchstone::diagnosis::selection {

bool HasPoseColumns(const touches::Observations& o, const touches::Prediction& d,
                    const std::vector<double>& residuals, int k) {
  for (int i = 0; i < o.fingers; ++i) {
    const size_t e = static_cast<size_t>(k) * o.fingers + i;
    if (!std::isfinite(residuals[e]) || !d.contact_m[e].allFinite() || !d.normal[e].allFinite() ||
        !std::isfinite(d.inverse_speed_s_per_m[e]) || !(d.cos_incidence[e] > touches::kTouchRules.min_cosine))
      return false;
  }
  return true;
}

bool HasPoseDetails(const touches::Prediction& d, const std::vector<double>& residuals) {
  return d.contact_m.size() == residuals.size() && d.normal.size() == residuals.size() &&
         d.inverse_speed_s_per_m.size() == residuals.size() && d.cos_incidence.size() == residuals.size();
}

int CentrePoses(const std::vector<int>& pose, int fingers, Eigen::MatrixXd* rows) {
  std::map<int, std::vector<int>> poses;
  for (int t = 0; t < static_cast<int>(pose.size()); ++t) poses[pose[t]].push_back(t);
  int repeats = 0;
  for (const auto& [number, members] : poses) {
    Eigen::MatrixXd mean = Eigen::MatrixXd::Zero(fingers, rows->cols());
    for (const int t : members) mean += rows->middleRows(t * fingers, fingers) / members.size();
    for (const int t : members) rows->middleRows(t * fingers, fingers) -= mean;
    repeats += static_cast<int>(members.size()) - 1;
  }
  return repeats;
}

Eigen::MatrixXd PoseColumns(const touches::Observations& o, const touches::Prediction& d, int k) {
  Eigen::MatrixXd columns(o.fingers, kPoseValues);
  const Eigen::Vector3d& approach = o.set->approach[o.row[k]];
  for (int i = 0; i < o.fingers; ++i) {
    const size_t e = static_cast<size_t>(k) * o.fingers + i;
    const Eigen::Vector3d per_metre = d.normal[e] / d.normal[e].dot(approach) * d.inverse_speed_s_per_m[e];
    columns.row(i) << per_metre.transpose(), d.contact_m[e].cross(per_metre).transpose();
  }
  columns.rowwise() -= columns.colwise().mean().eval();
  return columns;
}

}  // namespace touchstone::diagnosis::selection
