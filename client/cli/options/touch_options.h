// One touch, or the view of one, given by options: --approach and so on. What is left out is chosen by the object.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "client/cli/common/common.h"
#include "server/geometry/mesh/mesh.h"

namespace touchstone::cli {

struct TouchFlags {
  std::string target_mm;  // empty: the centre of the object's bounding box
  std::string approach;
  std::string lateral;
  std::optional<double> standoff_mm;  // none: by the object, as the command says
  double speed_mm_s = 20;
};
// `default_standoff` ends the help of --standoff-mm: what the command takes if it is not given.
void AddTouchOptions(CLI::App* command, const std::string& default_standoff, TouchFlags* options);

// The touch as far as the options say it; INVALID_ARGUMENT names the option. target_m is unset if --target-mm was not
// given, standoff_m 0 if --standoff-mm was not: AimAtObject fills them in.
absl::StatusOr<v1::CommandedTouch> MakeTouch(const TouchFlags& options);
// How far from the target the default start of the touch is, metres; all in the object frame.
using StandoffOf = std::function<double(const geometry::Bounds& bounds, const Eigen::Vector3d& target_m,
                                        const Eigen::Vector3d& approach)>;
void AimAtObject(const TouchFlags& options, const geometry::Bounds& bounds, const StandoffOf& standoff,
                 v1::CommandedTouch* touch);

// The bounding box of an object of the source; NOT_FOUND, with the nearest name, where it has none of that name.
absl::StatusOr<geometry::Bounds> BoundsOfObject(client::Connection* connection, const std::string& object);

}  // namespace touchstone::cli
