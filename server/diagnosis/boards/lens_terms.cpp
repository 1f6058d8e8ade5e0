#include "server/diagnosis/boards/lens_terms.h"

namespace touchstone::diagnosis::boards {

const std::vector<LensTerm>& LensTerms() {
  static const auto* terms = new std::vector<LensTerm>{
      {"focal_error", {kFocal}},
      {"principal_point", {kOffsetX, kOffsetY}},
      {"radial_distortion", {kK1, kK2}},
      {"tangential distortion", {kP1, kP2}, false},
      {"radial distortion of sixth order", {kK3}, false},
      {"pixels that are not square", {kAspect}, false},
  };
  return *terms;
}

bool ProjectCorner(const session::CameraIntrinsics& nominal, const LensVector& lens, const BoardPose& pose,
                   const Eigen::Vector2d& corner_m, ProjectedCorner* projected) {
  const Eigen::Vector3d turned = pose.rotation * Eigen::Vector3d(corner_m.x(), corner_m.y(), 0);
  const Eigen::Vector3d point = turned + pose.translation_m;
  if (!(point.z() > 1e-9)) return false;
  const double x = point.x() / point.z(), y = point.y() / point.z();
  const double k1 = nominal.k1 + lens[kK1], k2 = nominal.k2 + lens[kK2], k3 = nominal.k3 + lens[kK3];
  const double p1 = nominal.p1 + lens[kP1], p2 = nominal.p2 + lens[kP2];
  const double r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2;
  const double radial = 1 + k1 * r2 + k2 * r4 + k3 * r6;
  const double slope = k1 + 2 * k2 * r2 + 3 * k3 * r4;  // of `radial` by r^2
  const double xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
  const double yd = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
  const double fx = nominal.fx_px * (1 + lens[kFocal]) * (1 + lens[kAspect]);
  const double fy = nominal.fy_px * (1 + lens[kFocal]);
  projected->px = {fx * xd + nominal.cx_px + lens[kOffsetX], fy * yd + nominal.cy_px + lens[kOffsetY]};

  auto& by_lens = projected->by_lens;
  by_lens.col(kFocal) << nominal.fx_px * (1 + lens[kAspect]) * xd, nominal.fy_px * yd;
  by_lens.col(kOffsetX) << 1, 0;
  by_lens.col(kOffsetY) << 0, 1;
  by_lens.col(kK1) << fx * x * r2, fy * y * r2;
  by_lens.col(kK2) << fx * x * r4, fy * y * r4;
  by_lens.col(kP1) << fx * 2 * x * y, fy * (r2 + 2 * y * y);
  by_lens.col(kP2) << fx * (r2 + 2 * x * x), fy * 2 * x * y;
  by_lens.col(kK3) << fx * x * r6, fy * y * r6;
  by_lens.col(kAspect) << nominal.fx_px * (1 + lens[kFocal]) * xd, 0;

  // By the point: through the lens, then the division by depth.
  Eigen::Matrix2d by_slopes;
  by_slopes << radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x,
      2 * x * y * slope + 2 * p1 * x + 2 * p2 * y, 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y,
      radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x;
  by_slopes.row(0) *= fx;
  by_slopes.row(1) *= fy;
  Eigen::Matrix<double, 2, 3> by_point;
  by_point << 1, 0, -x, 0, 1, -y;
  by_point = by_slopes * by_point / point.z();
  Eigen::Matrix3d cross;  // by a turn w the point moves by w x turned
  cross << 0, turned.z(), -turned.y(), -turned.z(), 0, turned.x(), turned.y(), -turned.x(), 0;
  projected->by_pose.leftCols<3>() = by_point * cross;
  projected->by_pose.rightCols<3>() = by_point;
  return true;
}

}  // namespace touchstone::diagnosis::boards
