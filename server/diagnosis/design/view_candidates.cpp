#include "server/diagnosis/design/view_candidates.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/random.h"
#include "server/base/units.h"
#include "server/diagnosis/design/rules.h"

namespace touchstone::diagnosis::design {
namespace {

constexpr double kDistances[] = {1, 0.7, 1.4, 0.5, 2};  // of the median distance
constexpr double kGoldenTurn = 0.6180339887498949;

struct Axes {
  Eigen::Vector3d right, down, forward;
};

Axes AxesOf(const session::CameraPlacement& camera) {
  Axes axes;
  axes.forward = (camera.at_m - camera.eye_m).normalized();
  axes.right = axes.forward.cross(camera.up).normalized();
  axes.down = axes.forward.cross(axes.right);
  return axes;
}

double MedianDistanceM(const images::Photographs& photographs) {
  std::vector<double> distances;
  for (int k = 0; k < photographs.size(); ++k) {
    const geometry::Bounds& bounds = photographs.surfaces[photographs.object[k]]->bounds();
    distances.push_back((photographs.requests[k].camera.eye_m - bounds.Centre()).norm());
  }
  std::nth_element(distances.begin(), distances.begin() + distances.size() / 2, distances.end());
  return distances[distances.size() / 2];
}

// Whether every photograph was taken from above its object's underside.
bool StandsOnTable(const images::Photographs& photographs) {
  for (int k = 0; k < photographs.size(); ++k)
    if (photographs.requests[k].camera.eye_m.z() <
        photographs.surfaces[photographs.object[k]]->bounds().min_m.z())
      return false;
  return true;
}

// A number in 0 to 1 whose row fills the interval evenly (van der Corput).
double RadicalInverse(int number, int base) {
  double value = 0, digit = 1.0 / base;
  for (; number > 0; number /= base, digit /= base) value += digit * (number % base);
  return value;
}

// Numbers that a person can read off a plan: 0.01 mm, and 1e-4 of a direction.
session::CameraPlacement Rounded(session::CameraPlacement camera) {
  // Rounded as they are written, in millimetres, so that a file has "-31.33" and reads back the same camera.
  const auto length = [](double metres) {
    return ToSi(Unit::kMillimetre, std::round(FromSi(Unit::kMillimetre, metres) * 100) / 100 + 0.0);
  };
  const auto direction = [](double part) { return std::round(part * 1e4) / 1e4 + 0.0; };
  camera.eye_m = camera.eye_m.unaryExpr(length);
  camera.at_m = camera.at_m.unaryExpr(length);
  camera.up = camera.up.unaryExpr(direction);
  return camera;
}

// View `n` of a row that fills directions, distances, turns and places in the picture evenly.
ViewCandidate DrawView(const images::Photographs& photographs, int object, int n, double distance_m,
                       double lowest, double first_turn) {
  const geometry::Bounds& bounds = photographs.surfaces[object]->bounds();
  const session::CameraIntrinsics& lens = photographs.set->camera;
  const Eigen::Vector3d centre = bounds.Centre();
  const double sine = lowest + (kDesignRules.highest_sine - lowest) * RadicalInverse(n + 1, 3),
               cosine = std::sqrt(1 - sine * sine);
  const double azimuth = 2 * M_PI * (first_turn + kGoldenTurn * n);
  const double distance = distance_m * kDistances[n % std::size(kDistances)];
  ViewCandidate view;
  view.object = object;
  view.camera.eye_m =
      centre + distance * Eigen::Vector3d(cosine * std::cos(azimuth), cosine * std::sin(azimuth), sine);
  view.camera.at_m = centre;
  const Axes upright = AxesOf(view.camera);
  // Turned by 90 deg every other time that the distances were gone through.
  const int round = n / static_cast<int>(std::size(kDistances));
  if (round % 2 == 1) view.camera.up = upright.right;
  // In the middle, or towards one of the corners.
  if (round % 3 == 0) return view;
  const Axes axes = AxesOf(view.camera);
  const double radius_m = 0.5 * bounds.DiagonalM();
  const double free_x = 0.5 * lens.width_px / lens.fx_px * distance - radius_m,
               free_y = 0.5 * lens.height_px / lens.fy_px * distance - radius_m;
  const double towards_rim = kDesignRules.towards_rim;
  const double along = n % 2 == 0 ? towards_rim : -towards_rim,
               down = n / 2 % 2 == 0 ? towards_rim : -towards_rim;
  view.camera.at_m += along * std::max(free_x, 0.0) * axes.right + down * std::max(free_y, 0.0) * axes.down;
  return view;
}

bool IsAllowed(const images::Photographs& photographs, const ViewCandidate& view, bool table) {
  const geometry::Bounds& bounds = photographs.surfaces[view.object]->bounds();
  const Eigen::Vector3d from = view.camera.eye_m - bounds.Centre();
  if (from.norm() < kDesignRules.min_clearance * 0.5 * bounds.DiagonalM()) return false;
  const double height_m = view.camera.eye_m.z() - bounds.min_m.z();
  if (table &&
      height_m < std::tan(kDesignRules.lowest_over_table_deg * kRadiansPerDegree) * from.head<2>().norm())
    return false;
  return IsInPicture(photographs, view, kDesignRules.picture_margin);
}

// How far apart two views of one object are: the angle between them, and the logarithm of their distances' ratio.
double Apart(const Eigen::Vector3d& one, const Eigen::Vector3d& other) {
  const double cosine = one.dot(other) / std::max(one.norm() * other.norm(), 1e-12);
  return std::hypot(std::acos(std::clamp(cosine, -1.0, 1.0)),
                    std::log(std::max(one.norm(), 1e-12) / std::max(other.norm(), 1e-12)));
}

}  // namespace

bool IsInPicture(const images::Photographs& photographs, const ViewCandidate& view, double margin) {
  const session::CameraIntrinsics& lens = photographs.set->camera;
  const geometry::Bounds& bounds = photographs.surfaces[view.object]->bounds();
  const Axes axes = AxesOf(view.camera);
  const double rim = margin * std::min(lens.width_px, lens.height_px);
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d point(corner & 1 ? bounds.max_m.x() : bounds.min_m.x(),
                                corner & 2 ? bounds.max_m.y() : bounds.min_m.y(),
                                corner & 4 ? bounds.max_m.z() : bounds.min_m.z());
    const Eigen::Vector3d seen = point - view.camera.eye_m;
    const double depth_m = seen.dot(axes.forward);
    if (!(depth_m > 0)) return false;
    const double x = lens.cx_px + lens.fx_px * seen.dot(axes.right) / depth_m,
                 y = lens.cy_px + lens.fy_px * seen.dot(axes.down) / depth_m;
    if (!(x >= rim && x <= lens.width_px - rim && y >= rim && y <= lens.height_px - rim)) return false;
  }
  return true;
}

std::vector<ViewCandidate> ListViews(const images::Photographs& photographs, int max_views, uint64_t seed) {
  const int objects = static_cast<int>(photographs.objects.size());
  if (photographs.size() == 0 || objects == 0) return {};
  const double distance_m = MedianDistanceM(photographs);
  const bool table = StandsOnTable(photographs);
  const int per_object = std::max(max_views / objects, 4);
  std::vector<ViewCandidate> views;
  RandomStream random(seed, RandomDomain::kDiagnosis);
  for (int object = 0; object < objects; ++object) {
    const double first_turn = random.Uniform(0, 1);
    int found = 0;
    for (int n = 0; n < kDesignRules.max_tries * per_object && found < per_object; ++n) {
      ViewCandidate view = DrawView(photographs, object, n, distance_m,
                                    table ? 0 : kDesignRules.lowest_sine.value(), first_turn);
      view.camera = Rounded(view.camera);
      if (!IsAllowed(photographs, view, table)) continue;
      views.push_back(view);
      ++found;
    }
  }
  return views;
}

std::vector<ViewCandidate> MostDifferentViews(const images::Photographs& photographs,
                                              const std::vector<ViewCandidate>& candidates, int count) {
  const int objects = static_cast<int>(photographs.objects.size());
  std::vector<std::vector<Eigen::Vector3d>> known(objects);  // from the object's centre
  const auto from = [&](int object, const Eigen::Vector3d& eye_m) {
    return (eye_m - photographs.surfaces[object]->bounds().Centre()).eval();
  };
  for (int k = 0; k < photographs.size(); ++k)
    known[photographs.object[k]].push_back(from(photographs.object[k], photographs.requests[k].camera.eye_m));
  std::vector<ViewCandidate> chosen;
  while (static_cast<int>(chosen.size()) < count) {
    int best = -1;
    double best_apart = 0;
    for (size_t c = 0; c < candidates.size(); ++c) {
      const int object = candidates[c].object;
      if (best >= 0 && known[object].size() > known[candidates[best].object].size()) continue;
      double apart = 10;
      for (const Eigen::Vector3d& other : known[object])
        apart = std::min(apart, Apart(from(object, candidates[c].camera.eye_m), other));
      const bool fewer = best >= 0 && known[object].size() < known[candidates[best].object].size();
      if (apart > 0 && (best < 0 || fewer || apart > best_apart))
        best = static_cast<int>(c), best_apart = apart;
    }
    if (best < 0) break;
    chosen.push_back(candidates[best]);
    known[candidates[best].object].push_back(from(candidates[best].object, candidates[best].camera.eye_m));
  }
  return chosen;
}

}  // namespace touchstone::diagnosis::design
