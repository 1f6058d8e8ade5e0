#include "server/gateway/calibration/object_registration.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>
#include <Eigen/Core>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/decompositions.h"
#include "server/base/status.h"
#include "server/base/units.h"
#include "server/geometry/pose.h"

namespace touchstone::gateway::calibration {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

constexpr double kReachM = 0.03;  // how far before and behind a contact the surface is looked for
constexpr double kGrazingCosine =
    0.15;                        // of approach and normal; below, the distance along the approach says little
constexpr double kMissM = 0.01;  // what a contact that meets no surface counts as
constexpr double kMinScaleM = 5e-6;     // of the robust weights
constexpr double kOutlier = 5;          // robust standard deviations
constexpr double kUndetermined = 0.02;  // singular value below which a direction is undetermined
constexpr double kWorstRmsM = 0.002;    // above, the contacts are of something else
constexpr double kMaxLeftOut = 0.25;
constexpr int kMaxSteps = 100;
constexpr double kStartShiftM = 0.004,
                 kStartTurnRad = 2.5 * kRadiansPerDegree;  // between the starts that are tried
constexpr double kMaxShiftM = 0.02, kMaxTurnRad = 15 * kRadiansPerDegree;  // from the start

// Contacts against the surface at one pose.
struct Fit {
  std::vector<bool> met;
  std::vector<double> rest_m;  // from the measured point to the surface along the approach
  std::vector<Vector6d>
      gradient;        // of rest_m by a shift and a turn (times the scale) about the pivot, base frame
  double scale_m = 0;  // robust standard deviation
  double cost = 0;     // mean of robust losses, m^2
};

Matrix3d Cross(const Vector3d& v) {
  Matrix3d cross;
  cross << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return cross;
}

class Registration {
 public:
  Registration(const geometry::Surface& surface, const std::vector<RegistrationContact>& contacts)
      : surface_(surface) {
    for (const RegistrationContact& contact : contacts) {
      points_m_.push_back(contact.base_from_tip * Vector3d(contact.finger_x_m, 0, 0));
      approaches_.push_back(contact.base_from_tip.linear() * Vector3d::UnitZ());
    }
    for (const Vector3d& point_m : points_m_) pivot_m_ += point_m / static_cast<double>(points_m_.size());
    double squares = 0;
    for (const Vector3d& point_m : points_m_) squares += (point_m - pivot_m_).squaredNorm();
    // What turns a rotation into a typical shift.
    length_m_ = std::max(1e-3, std::sqrt(squares / static_cast<double>(points_m_.size())));
  }

  // Near an edge a bad start meets the wrong face and may settle there: of several starts about the given
  // one, the pose that fits the most contacts, and those best, is taken.
  absl::StatusOr<ObjectRegistration> Solve(const Isometry3d& start) {
    absl::StatusOr<ObjectRegistration> best = Finish(start, Descend(start));
    for (int axis = 0; axis < 6; ++axis)
      for (const double sign : {-1.0, 1.0}) {
        Vector6d change = Vector6d::Zero();
        change[axis] = sign * (axis < 3 ? kStartShiftM : kStartTurnRad * length_m_);
        const absl::StatusOr<ObjectRegistration> other = Finish(start, Descend(Moved(start, change)));
        if (!other.ok()) continue;
        if (!best.ok() || other->left_out < best->left_out ||
            (other->left_out == best->left_out && other->rms_m < best->rms_m))
          best = other;
      }
    return best;
  }

 private:
  Isometry3d Descend(const Isometry3d& start) const {
    Isometry3d pose = start;
    // The scale of the losses only falls, so that costs can be compared: wide at a bad start, then as the
    // data have it.
    double scale_m = kMissM;
    Fit fit = Evaluate(pose, scale_m);
    double damping = 1e-3;
    for (int step = 0; step < kMaxSteps; ++step) {
      const Vector6d change = Step(fit, scale_m, damping);
      const Isometry3d moved = Moved(pose, change);
      Fit next = Evaluate(moved, scale_m);
      if (next.cost < fit.cost) {
        const bool settled = change.norm() < 1e-9 || next.cost > fit.cost * (1 - 1e-9);
        pose = moved;
        damping = std::max(damping / 10, 1e-12);
        const double narrower_m = std::max(kMinScaleM, std::min(scale_m, 2 * next.scale_m));
        const bool narrowed = narrower_m < 0.9 * scale_m;
        if (narrowed) {
          scale_m = narrower_m;
          next = Evaluate(pose, scale_m);
        }
        fit = std::move(next);
        if (settled && !narrowed) break;
      } else {
        damping *= 10;
        if (damping > 1e6) {
          const double narrower_m = std::max(kMinScaleM, std::min(scale_m, 2 * fit.scale_m));
          if (narrower_m > 0.9 * scale_m) break;
          scale_m = narrower_m;
          damping = 1e-3;
          fit = Evaluate(pose, scale_m);
        }
      }
    }
    return pose;
  }

  Fit Evaluate(const Isometry3d& base_from_object, double scale_m) const {
    const size_t count = points_m_.size();
    const Isometry3d object_from_base = base_from_object.inverse();
    std::vector<Vector3d> origins_m(count), directions(count);
    for (size_t i = 0; i < count; ++i) {
      directions[i] = (object_from_base.linear() * approaches_[i]).normalized();
      origins_m[i] = object_from_base * points_m_[i] - kReachM * directions[i];
    }
    geometry::Contacts contacts;
    surface_.CastLines(origins_m, directions, 2 * kReachM, &contacts);
    Fit fit;
    fit.met.assign(count, false);
    fit.rest_m.assign(count, kMissM);
    fit.gradient.assign(count, Vector6d::Zero());
    std::vector<double> sizes_m;
    for (size_t i = 0; i < count; ++i) {
      if (std::isnan(contacts.travel_m[i])) continue;
      const Vector3d normal = base_from_object.linear() * contacts.normal[i];
      const double cosine = normal.dot(approaches_[i]);
      if (std::abs(cosine) < kGrazingCosine) continue;
      fit.met[i] = true;
      fit.rest_m[i] = contacts.travel_m[i] - kReachM;
      // The tangent plane at the contact moves with the object.
      const Vector3d arm_m = base_from_object * contacts.point_m[i] - pivot_m_;
      fit.gradient[i].head<3>() = normal / cosine;
      fit.gradient[i].tail<3>() = arm_m.cross(normal) / cosine / length_m_;
      sizes_m.push_back(std::abs(fit.rest_m[i]));
    }
    fit.scale_m = kMissM;
    if (!sizes_m.empty()) {
      std::nth_element(sizes_m.begin(), sizes_m.begin() + sizes_m.size() / 2, sizes_m.end());
      fit.scale_m = std::max(kMinScaleM, 1.4826 * sizes_m[sizes_m.size() / 2]);
    }
    for (size_t i = 0; i < count; ++i) fit.cost += Loss(fit.rest_m[i], scale_m) / static_cast<double>(count);
    return fit;
  }

  // Cauchy's: quadratic within the scale, logarithmic beyond.
  static double Loss(double rest_m, double scale_m) {
    return 0.5 * scale_m * scale_m * std::log1p(rest_m * rest_m / (scale_m * scale_m));
  }

  Vector6d Step(const Fit& fit, double scale_m, double damping) const {
    Matrix6d normal = Matrix6d::Zero();
    Vector6d right = Vector6d::Zero();
    for (size_t i = 0; i < fit.rest_m.size(); ++i) {
      if (!fit.met[i]) continue;
      const double weight = 1 / (1 + std::pow(fit.rest_m[i] / scale_m, 2));
      normal += weight * fit.gradient[i] * fit.gradient[i].transpose();
      right -= weight * fit.gradient[i] * fit.rest_m[i];
    }
    const double ridge = damping * std::max(1e-9, normal.trace() / 6);
    normal.diagonal().array() += ridge;
    return SymmetricSolver(normal).Solve(right);
  }

  // A shift, and a turn about the pivot, in the base frame.
  Isometry3d Moved(const Isometry3d& pose, const Vector6d& change) const {
    const Vector3d turn = change.tail<3>() / length_m_;
    Isometry3d move = Isometry3d::Identity();
    move.linear() = geometry::RotationFromVector(turn);
    move.translation() = pivot_m_ + change.head<3>() - move.linear() * pivot_m_;
    Isometry3d moved = move * pose;
    moved.linear() = Eigen::Quaterniond(moved.linear()).normalized().toRotationMatrix();
    return moved;
  }

  // Plain least squares over the contacts that belong to it, and what they tell.
  absl::StatusOr<ObjectRegistration> Finish(const Isometry3d& start, Isometry3d pose) const {
    std::vector<bool> used;
    Fit fit = Evaluate(pose, kMinScaleM);
    for (int step = 0; step < 10; ++step) {
      used = fit.met;
      for (size_t i = 0; i < used.size(); ++i)
        used[i] = used[i] && std::abs(fit.rest_m[i]) <= std::max(kOutlier * fit.scale_m, 10 * kMinScaleM);
      const Matrix6d normal = Normal(fit, used);
      if (absl::Status status = CheckDetermined(normal, used); !status.ok()) return status;
      Vector6d right = Vector6d::Zero();
      for (size_t i = 0; i < used.size(); ++i)
        if (used[i]) right -= fit.gradient[i] * fit.rest_m[i];
      const Vector6d change = SymmetricSolver(normal).Solve(right);
      pose = Moved(pose, change);
      fit = Evaluate(pose, kMinScaleM);
      if (change.norm() < 1e-10) break;
    }
    ObjectRegistration result;
    double squares = 0;
    for (size_t i = 0; i < used.size(); ++i) {
      if (!used[i] || !fit.met[i]) continue;
      ++result.contacts;
      squares += fit.rest_m[i] * fit.rest_m[i];
    }
    result.left_out = used.size() - result.contacts;
    if (result.contacts < kMinRegistrationContacts ||
        static_cast<double>(result.left_out) > kMaxLeftOut * static_cast<double>(used.size()))
      return absl::FailedPreconditionError(
          absl::StrCat(result.left_out, " of ", used.size(),
                       " contacts fit no pose near the start; check that '", surface_.name(),
                       "' is the object that lies there, and that the start is within 5 mm and 3 degrees"));
    const double variance = squares / static_cast<double>(result.contacts - 6);
    result.rms_m = std::sqrt(variance);
    const Isometry3d moved = start.inverse() * pose;
    const double shift_m = (pose * surface_.bounds().Centre() - start * surface_.bounds().Centre()).norm();
    const double turn_rad = std::abs(Eigen::AngleAxisd(moved.linear()).angle());
    if (result.rms_m > kWorstRmsM || shift_m > kMaxShiftM || turn_rad > kMaxTurnRad)
      return absl::FailedPreconditionError(
          absl::StrFormat("the contacts fit '%s' badly: %.2f mm are left over, %.1f mm and %.1f degrees from "
                          "the start; check that it is "
                          "the object that lies there, and start within 5 mm and 3 degrees",
                          surface_.name(), result.rms_m * kMillimetresPerMetre,
                          shift_m * kMillimetresPerMetre, turn_rad / kRadiansPerDegree));
    result.base_from_object = pose;
    const Matrix6d normal = Normal(fit, used);
    const Eigen::VectorXd eigenvalues = EigenvaluesOfSymmetric(normal / static_cast<double>(result.contacts));
    for (int k = 0; k < 6; ++k) result.singular_values[k] = std::sqrt(std::max(0.0, eigenvalues[5 - k]));
    // From a shift of the pivot and a scaled turn to the origin's shift and the turn.
    Matrix6d to_origin = Matrix6d::Identity();
    to_origin.topRightCorner<3, 3>() = -Cross(pose.translation() - pivot_m_) / length_m_;
    to_origin.bottomRightCorner<3, 3>() = Matrix3d::Identity() / length_m_;
    const Matrix6d covariance = to_origin *
                                (variance * SymmetricSolver(normal).SolveColumns(Matrix6d::Identity())) *
                                to_origin.transpose();
    for (int k = 0; k < 3; ++k) {
      result.translation_std_error_m[k] = std::sqrt(covariance(k, k));
      result.rotation_std_error_rad[k] = std::sqrt(covariance(3 + k, 3 + k));
    }
    return result;
  }

  static Matrix6d Normal(const Fit& fit, const std::vector<bool>& used) {
    Matrix6d normal = Matrix6d::Zero();
    for (size_t i = 0; i < used.size(); ++i)
      if (used[i]) normal += fit.gradient[i] * fit.gradient[i].transpose();
    return normal;
  }

  absl::Status CheckDetermined(const Matrix6d& normal, const std::vector<bool>& used) const {
    const auto count = static_cast<double>(std::count(used.begin(), used.end(), true));
    if (count < kMinRegistrationContacts)
      return absl::FailedPreconditionError(absl::StrCat("only ", count, " of ", used.size(),
                                                        " contacts meet '", surface_.name(),
                                                        "' near the start; check the object and the start"));
    const SymmetricEigen eigen = EigenOfSymmetric(normal / count);
    std::vector<std::string> unknown;
    for (int k = 0; k < 6; ++k)
      if (std::sqrt(std::max(0.0, eigen.values[k])) < kUndetermined)
        unknown.push_back(InWords(eigen.vectors.col(k)));
    if (unknown.empty()) return absl::OkStatus();
    return absl::FailedPreconditionError(absl::StrCat(
        "the contacts with '", surface_.name(), "' cannot determine ", unknown.size(),
        " of 6 directions: ", absl::StrJoin(unknown, "; "), "; touch faces that stand across them"));
  }

  // "shift along x and turn about z": the large parts of a direction, base frame.
  static std::string InWords(const Vector6d& direction) {
    static const char* const kNames[] = {"shift along x", "shift along y", "shift along z",
                                         "turn about x",  "turn about y",  "turn about z"};
    const double largest = direction.cwiseAbs().maxCoeff();
    std::vector<std::string> parts;
    for (int k = 0; k < 6; ++k)
      if (std::abs(direction[k]) > 0.3 * largest) parts.push_back(kNames[k]);
    return absl::StrJoin(parts, " with ");
  }

  const geometry::Surface& surface_;
  std::vector<Vector3d> points_m_, approaches_;  // base frame
  Vector3d pivot_m_ = Vector3d::Zero();          // the middle of the contacts
  double length_m_ = 1;
};

}  // namespace

absl::StatusOr<ObjectRegistration> RegisterObject(const geometry::Surface& surface,
                                                  const std::vector<RegistrationContact>& contacts,
                                                  const Isometry3d& start) {
  if (contacts.size() < kMinRegistrationContacts)
    return absl::InvalidArgumentError(absl::StrCat(
        "the registration of '", surface.name(), "' has ", contacts.size(), " contacts; at least ",
        kMinRegistrationContacts, " are needed for six unknowns, 30 on several faces are good"));
  for (size_t i = 0; i < contacts.size(); ++i)
    if (!contacts[i].base_from_tip.matrix().allFinite() || !std::isfinite(contacts[i].finger_x_m))
      return absl::InvalidArgumentError(
          absl::StrCat("contact ", i, " has a pose that is not finite; leave out what was not measured"));
  return Registration(surface, contacts).Solve(start);
}

}  // namespace touchstone::gateway::calibration
