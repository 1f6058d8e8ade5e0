// What makes single touches and photographs for a physical source (physical_source.h), and keeps them in a
// journal: a rig (gateway/rig/), or the journal of one, served again (recorded_rig.h).
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <absl/status/statusor.h>
#include <Eigen/Geometry>

#include "server/geometry/mesh/mesh.h"
#include "server/image/image.h"
#include "server/image/photograph/photograph.h"
#include "server/session/journal/journal.h"
#include "server/source/motion_guard.h"
#include "server/source/source_state.h"
#include "server/touch/commanded_touch.h"

namespace touchstone::source {

struct TouchCommand {
  std::string session, id;  // the touch is journalled under this id
  std::string object;
  geometry::Bounds bounds;  // of the object, object frame
  touch::CommandedTouch touch;
  std::string bytes;    // the touch as the journal keeps it: command_bytes.h, without the session time
  bool series = false;  // the arm's states during the approach are journalled too
  uint64_t repeat = 0;  // which repeat of the same touch this is, from 0, as far as the caller knows
};

struct ViewCommand {
  std::string session;
  std::string object;
  geometry::Bounds bounds;                                               // of the object, object frame
  Eigen::Isometry3d object_from_camera = Eigen::Isometry3d::Identity();  // z looks ahead, y down
  // The same as the client said it, which the journal keeps; none: a check, which photographs nothing.
  std::optional<image::Camera> commanded;
};

// A picture, and where it was taken from.
struct Photograph {
  image::Frame frame;
  std::optional<Eigen::Isometry3d> object_from_camera;  // measured; none: unknown
  double unix_s = 0;                                    // when it was taken
  double deviation_m = 0, deviation_rad = 0;            // of the measured pose from the commanded one
};

// A view's name in the journal: the object and the pose, to the micrometre.
std::string ViewId(const ViewCommand& command);

// How a device is doing; times in seconds.
struct SourceStatus {
  std::string object;  // on the fixture; empty: unknown
  std::string last_error;
  uint32_t recovered_touches = 0, interrupted_touches = 0;
  double touch_duration_s = 0;     // of the last ones, host time; 0: none yet
  double clock_uncertainty_s = 0;  // of contact times, standard
  uint64_t touches = 0, images = 0;
  int image_width = 0, image_height = 0;  // of the last one
};

// Every function may be called from several threads; touches and photographs take turns.
class RigDevice {
 public:
  virtual ~RigDevice() = default;
  // The touch as it was made. One whose id is journalled already is answered from there; ALREADY_EXISTS if that
  // was another touch.
  virtual absl::StatusOr<session::JournalTouch> Touch(const TouchCommand& command,
                                                      const MotionGuard& guard) = 0;
  // What was recorded during a touch that is done; none: that was not asked for.
  virtual absl::StatusOr<std::optional<session::JournalSeries>> Series(const std::string& session,
                                                                       const std::string& id) const = 0;
  // FAILED_PRECONDITION if the camera was not where it was commanded to be, within the device's tolerance.
  virtual absl::StatusOr<source::Photograph> Photograph(const ViewCommand& command,
                                                        const MotionGuard& guard) = 0;
  virtual bool has_camera() const = 0;
  // Of the camera that took this picture.
  virtual image::Intrinsics IntrinsicsOf(const image::Frame& frame) const = 0;
  virtual int fingers() const = 0;
  virtual double spacing_m() const = 0;
  // True if it moves anything, so that a lease is needed.
  virtual bool moves() const = 0;
  virtual SourceStatus Status() const = 0;
  virtual SourceState State() const = 0;
};

}  // namespace touchstone::source
