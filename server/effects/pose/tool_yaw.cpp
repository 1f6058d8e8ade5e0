// Tool yaw: the end effector is mounted turned about its own axis, so the row of fingers is too.
//   s is rotated about a by the angle (right-hand rule):  s' = cos(angle) s + sin(angle) (a x s)
#include <cmath>

#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

struct Parameters {
  double angle_rad;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::angle_rad, "angle_deg", Unit::kDegree, -45, 45, 0, 2,
     "How far the row of fingers is turned about the approach, right-handed."},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  const double cosine = std::cos(p.angle_rad);
  const double sine = std::sin(p.angle_rad);
  // a and s are perpendicular, so Rodrigues' formula has no third term.
  for (int touch = 0; touch < touches.size(); ++touch) {
    const Eigen::Vector3d side = touches.approach[touch].cross(touches.lateral[touch]);
    touches.lateral[touch] = cosine * touches.lateral[touch] + sine * side;
  }
}

}  // namespace

model::Effect ToolYaw() {
  return DefineEffect<Parameters>({
      .name = "tool_yaw",
      .stage = model::Stage::kPose,
      .meaning =
          "The end effector is mounted turned about the approach: the outer fingers meet the surface beside "
          "the places that were commanded.",
      .signature =
          "Outer fingers are early or late where the surface slopes across the row of fingers (along a x s), "
          "with opposite signs left and right; flat faces met head-on show nothing. tool_tilt shows on "
          "flat faces too.",
      .check_on_rig =
          "Let the row of fingers touch a straight edge that should be parallel to it: the outer marks "
          "lie on both sides of the edge.",
      .remedy = "Loosen the flange, turn the tool against a straight edge, tighten; or set "
                "the tool frame of the arm.",
      .confounded_with =
          {
              {"object_pose", "Turn the object by 90 deg about the approach: a yaw stays with the tool."},
          },
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
