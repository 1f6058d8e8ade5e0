// Where an object lies on the fixture, from touches of it: the pose of its mesh that the measured
// contacts fit best.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Geometry>

#include "server/geometry/surface/surface.h"

namespace touchstone::gateway::calibration {

// One contact of one finger.
struct RegistrationContact {
  Eigen::Isometry3d base_from_tip = Eigen::Isometry3d::Identity();  // when this finger made it
  double finger_x_m = 0;  // where the finger stands on the tool's x axis: (i - (n - 1) / 2) * spacing
};

struct ObjectRegistration {
  Eigen::Isometry3d base_from_object = Eigen::Isometry3d::Identity();
  // Standard errors in the base frame: of the object's origin (m), and of the rotation vector (rad).
  std::array<double, 3> translation_std_error_m{}, rotation_std_error_rad{};
  double rms_m = 0;     // of the distances along the approach, per degree of freedom
  size_t contacts = 0;  // used
  size_t left_out = 0;  // beside the surface, at a grazing angle, or far off
  // How well the touches tell the six directions, best to worst: 1 is a direction that every contact
  // sees in full.
  std::array<double, 6> singular_values{};
};

inline constexpr size_t kMinRegistrationContacts = 7;

// Gauss-Newton from `start`, which may be 5 mm and 3 degrees off, minimising the distances along the approach
// between the measured points of contact and the surface; far-off contacts weigh less and at last nothing.
// INVALID_ARGUMENT: too few contacts. FAILED_PRECONDITION names the directions that the touches cannot
// determine (a flat face determines neither its shift in its plane nor its rotation about its normal), or
// says that the contacts fit no pose near the start.
absl::StatusOr<ObjectRegistration> RegisterObject(const geometry::Surface& surface,
                                                  const std::vector<RegistrationContact>& contacts,
                                                  const Eigen::Isometry3d& start);

}  // namespace touchstone::gateway::calibration
