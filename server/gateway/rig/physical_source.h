// What the services need of a physical source: a rig (rig.h), or what a rig once recorded
// (recorded_source.h).
#pragma once

#include <functional>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <Eigen/Geometry>

#include "server/gateway/camera/camera.h"
#include "server/geometry/mesh.h"
#include "server/session/journal.h"
#include "server/touch/commanded_touch.h"

namespace touchstone {

// Asked over and over while something moves; an error ends the motion and is what the caller gets. It tells,
// for instance, that the lease is lost or the client gone.
using Permit = std::function<absl::Status()>;

struct TouchOrder {
  std::string session, id;
  std::string object;
  Bounds bounds;  // of the object, object frame
  CommandedTouch touch;
  std::string command;  // serialised v1::CommandedTouch
  uint64_t repeat = 0;  // which repeat of the same command this is, where the order knows
};

struct ViewOrder {
  std::string session;
  std::string object;
  Bounds bounds;
  Eigen::Isometry3d object_from_camera = Eigen::Isometry3d::Identity();  // z looks ahead, y down
};

// A view's name in the journal: the object and the pose, to the micrometre.
std::string ViewId(const ViewOrder& order);

// An ideal pinhole with this field of view.
Intrinsics PinholeIntrinsics(int width, int height, double vertical_fov_rad);

struct PhysicalFacts {
  std::string object, placement, last_error;
  uint32_t recovered_touches = 0, interrupted_touches = 0;
  double touch_duration_s = 0;     // of the last ones, host time; 0: none yet
  double clock_uncertainty_s = 0;  // of contact times, standard
  uint64_t touches = 0, images = 0;
  int image_width = 0, image_height = 0;  // of the last one
};

class PhysicalSource {
 public:
  virtual ~PhysicalSource() = default;
  virtual absl::StatusOr<JournalTouch> Touch(const TouchOrder& order, const Permit& permit) = 0;
  virtual absl::StatusOr<Frame> Photograph(const ViewOrder& order, const Permit& permit) = 0;
  virtual bool has_camera() const = 0;
  // Of the camera that took this picture.
  virtual Intrinsics IntrinsicsOf(const Frame& frame) const = 0;
  virtual int fingers() const = 0;
  virtual double spacing_m() const = 0;
  // True if it moves anything, so that a lease is needed.
  virtual bool moves() const = 0;
  virtual PhysicalFacts Facts() const = 0;
  virtual std::string State() const = 0;  // control.proto
};

}  // namespace touchstone
