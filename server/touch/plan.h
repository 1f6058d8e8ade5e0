// Plans: which touches to make. A generator is a pure function of (seed, number, attempt).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/types/span.h>

#include "server/base/touch_limits.h"
#include "server/geometry/mesh/mesh.h"
#include "server/geometry/surface/surface.h"
#include "server/touch/commanded_touch.h"

namespace touchstone::touch {

// The seed's generator: theta and phi are uniform multiples of the step angle, the start lies on a sphere
// round the bounding box, the target is its centre. theta turns about z from +x; phi rises from the xy plane.
// lateral = approach x z, horizontal and to the right in the image; roll turns it about approach.
struct SpherePlan {
  double step_angle_rad = kDefaultStepAngleRad;
  double roll_step_rad = 0;    // 0: no roll
  double radius_ratio = 1.05;  // radius of the start sphere over half the box's diagonal
  // Largest incidence at any finger's contact; a quarter turn: any.
  double max_incidence_rad = 3.14159265358979323846 / 2;
  static constexpr double kDefaultStepAngleRad = 3.14159265358979323846 / 180;
};

// The seed's real protocol: rounds x samples a face x 6 faces of the bounding box (+x -x +y -y +z -z). Touch
// number n: round n / (6 samples), face (n / samples) mod 6. Every round repeats the same poses.
// A point is drawn on the face of the box and an approach within the cone around its inward normal; the target is where
// that line first meets the object's surface from outside. A draw is rejected, and the touch drawn again within its
// number, where the line meets nothing, where a finger starts inside of the object or behind a part of it, where a
// finger meets nothing within the stroke, or meets the surface at too large an incidence (draw_check.h).
struct FacesPlan {
  int samples_per_face = 8;
  int rounds = 4;
  double max_tilt_rad = 20 * 3.14159265358979323846 / 180;  // between approach and the inward face normal
  double spread = 0.6;  // targets lie within this share of the face's half sides
  double standoff_m = 0.06;
  // Largest angle at any finger's contact between the approach and the inward surface normal; a quarter turn: any.
  double max_incidence_rad = 60 * 3.14159265358979323846 / 180;
  // A finger must have met the object when it stands so far behind the target, as a rig's approach ends there.
  double stroke_beyond_target_m = kDefaultStrokeBeyondTargetM;
};

struct Plan {
  enum class Kind { kSphere, kFaces, kList };
  Kind kind = Kind::kSphere;
  SpherePlan sphere;
  FacesPlan faces;
  std::vector<CommandedTouch> list;
  double speed_m_s = kDefaultSpeedMS;  // of sphere and faces; a list's touches carry their own
  double touch_interval_s = 0;         // session_time_s = number * interval, for sphere and faces
};

// Checks every field; errors name it and what would be right. Makes a list's vectors exact.
absl::Status ValidatePlan(Plan* plan);

// The touches of one plan around one object.
class PoseGenerator {
 public:
  virtual ~PoseGenerator() = default;
  // The pose of touch `number`; `attempt` counts the draws that were rejected before. poses[k] is for numbers[k].
  virtual void Draw(absl::Span<const uint64_t> numbers, uint32_t attempt, TouchPose* poses) const = 0;
  // How many touches the plan has; 0: no end.
  virtual uint64_t Count() const = 0;
  // Whether a missed touch may be drawn again. Explicit touches may not.
  virtual bool CanRedraw() const = 0;
  // The one rule for a drawn touch: it stands if every finger hit, or if there is no other draw.
  bool Accepts(bool every_finger_hit) const { return every_finger_hit || !CanRedraw(); }
};

// Around the object that is touched; `plan` must be valid and outlive the generator, and so must the surface.
std::unique_ptr<PoseGenerator> MakePoseGenerator(const Plan& plan, const geometry::Surface& surface,
                                                 uint64_t seed);
// The same around several, one for each. An object that comes again shares its generator, and all share what they have
// in common: a request that names one object often costs no more memory.
std::vector<std::shared_ptr<const PoseGenerator>> MakePoseGenerators(
    const Plan& plan, absl::Span<const std::shared_ptr<const geometry::Surface>> surfaces, uint64_t seed);
// The same where only the box is known: targets of a faces plan then lie on the box's faces, on the same lines.
std::unique_ptr<PoseGenerator> MakePoseGenerator(const Plan& plan, const geometry::Bounds& bounds,
                                                 uint64_t seed);

// Touch `number` of the plan with everything that is commanded.
CommandedTouch TouchOfPlan(const Plan& plan, const PoseGenerator& generator, uint64_t number,
                           uint32_t attempt);

}  // namespace touchstone::touch
