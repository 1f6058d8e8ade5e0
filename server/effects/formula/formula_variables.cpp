// What an expression may use: the table behind `touchstone effects formula` and behind the compiler.
#include <algorithm>
#include <cmath>

#include "server/effects/formula/formula.h"

namespace touchstone::effects {
namespace {

constexpr double kMillimetres = 1.0 / kMetresPerMillimetre;

template <int axis>
double Approach(const TouchBatch& b, int, int touch) {
  return b.approach[touch][axis];
}
template <int axis>
double Lateral(const TouchBatch& b, int, int touch) {
  return b.lateral[touch][axis];
}
template <int axis>
double Normal(const TouchBatch& b, int finger, int touch) {
  return b.normal[b.At(finger, touch)][axis];
}
template <int axis>
double ContactMm(const TouchBatch& b, int finger, int touch) {
  return b.contact_m[b.At(finger, touch)][axis] * kMillimetres;
}
double Finger(const TouchBatch& b, int finger, int) {
  return b.FingerPosition(finger);
}
double SpeedMmS(const TouchBatch& b, int, int touch) {
  return b.speed_m_s[touch] * kMillimetres;
}
double SessionTimeS(const TouchBatch& b, int, int touch) {
  return b.session_time_s[touch];
}
double PauseS(const TouchBatch& b, int, int touch) {
  return b.pause_s[touch];
}
double PreviousPressMm(const TouchBatch& b, int finger, int touch) {
  return b.previous_press_m[b.At(finger, touch)] * kMillimetres;
}
double TravelMm(const TouchBatch& b, int finger, int touch) {
  return b.travel_m[b.At(finger, touch)] * kMillimetres;
}
double IncidenceDeg(const TouchBatch& b, int finger, int touch) {
  return std::acos(std::clamp(b.cos_incidence[b.At(finger, touch)], 0.0, 1.0)) / kRadiansPerDegree;
}
double CurvaturePerM(const TouchBatch& b, int finger, int touch) {
  return b.curvature_per_m[b.At(finger, touch)];
}
double First(const TouchBatch& b, int finger, int touch) {
  return b.first_finger[touch] == finger ? 1.0 : 0.0;
}
double FirstFinger(const TouchBatch& b, int, int touch) {
  return b.FingerPosition(b.first_finger[touch]);
}

constexpr FormulaVariable kVariables[] = {
    {"finger", "", model::Stage::kPose, "place of the finger in units of the spacing: -1, 0, 1 for l, m, r",
     Finger},
    {"speed_mm_s", "mm/s", model::Stage::kPose, "commanded speed", SpeedMmS},
    {"session_time_s", "s", model::Stage::kPose, "time since the session began", SessionTimeS},
    {"pause_s", "s", model::Stage::kPose, "time since the session's previous touch; 0 for the first", PauseS},
    {"previous_press_mm", "mm", model::Stage::kPose,
     "how far this finger was pressed in by the session's previous touch; 0 for the first", PreviousPressMm},
    {"approach_x", "", model::Stage::kPose, "direction of motion, unit vector in the object frame",
     Approach<0>},
    {"approach_y", "", model::Stage::kPose, "", Approach<1>},
    {"approach_z", "", model::Stage::kPose, "", Approach<2>},
    {"lateral_x", "", model::Stage::kPose,
     "direction from the first finger to the last, unit vector (after tool_yaw)", Lateral<0>},
    {"lateral_y", "", model::Stage::kPose, "", Lateral<1>},
    {"lateral_z", "", model::Stage::kPose, "", Lateral<2>},
    {"travel_mm", "mm", model::Stage::kContact,
     "travel of the finger until contact, with what effects above have added", TravelMm},
    {"incidence_deg", "deg", model::Stage::kContact,
     "angle between the approach and the inward surface normal", IncidenceDeg},
    {"curvature_per_m", "1/m", model::Stage::kContact, "mean curvature of the surface, positive where convex",
     CurvaturePerM},
    {"normal_x", "", model::Stage::kContact, "outward surface normal at the contact, unit vector", Normal<0>},
    {"normal_y", "", model::Stage::kContact, "", Normal<1>},
    {"normal_z", "", model::Stage::kContact, "", Normal<2>},
    {"contact_x_mm", "mm", model::Stage::kContact, "place of the contact in the object frame", ContactMm<0>},
    {"contact_y_mm", "mm", model::Stage::kContact, "", ContactMm<1>},
    {"contact_z_mm", "mm", model::Stage::kContact, "", ContactMm<2>},
    {"first", "", model::Stage::kMotion, "1 for the finger that touched first, else 0", First},
    {"first_finger", "", model::Stage::kMotion, "place of the finger that touched first, like `finger`",
     FirstFinger},
};

constexpr FormulaWord kFunctions[] = {
    {"sin", "sin(x)", "sine, x in rad"},
    {"cos", "cos(x)", "cosine, x in rad"},
    {"tan", "tan(x)", "tangent, x in rad"},
    {"asin", "asin(x)", "arc sine in rad"},
    {"acos", "acos(x)", "arc cosine in rad"},
    {"atan", "atan(x)", "arc tangent in rad"},
    {"atan2", "atan2(y, x)", "angle of the point (x, y) in rad"},
    {"sinh", "sinh(x)", "hyperbolic sine"},
    {"cosh", "cosh(x)", "hyperbolic cosine"},
    {"tanh", "tanh(x)", "hyperbolic tangent"},
    {"exp", "exp(x)", "e^x"},
    {"log", "log(x)", "natural logarithm"},
    {"log10", "log10(x)", "logarithm to base 10"},
    {"sqrt", "sqrt(x)", "square root"},
    {"abs", "abs(x)", "absolute value"},
    {"sign", "sign(x)", "-1, 0 or 1"},
    {"floor", "floor(x)", "largest whole number that is not above x"},
    {"ceil", "ceil(x)", "smallest whole number that is not below x"},
    {"round", "round(x)", "nearest whole number, halves away from 0"},
    {"hypot", "hypot(x, y)", "sqrt(x^2 + y^2)"},
    {"min", "min(x, y, ...)", "smallest of its arguments"},
    {"max", "max(x, y, ...)", "largest of its arguments"},
};

constexpr FormulaWord kConstants[] = {
    {"pi", "pi", "3.14159...; deg to rad is pi/180"},
    {"e", "e", "2.71828..."},
};

}  // namespace

absl::Span<const FormulaVariable> FormulaVariables() {
  return kVariables;
}
absl::Span<const FormulaWord> FormulaFunctions() {
  return kFunctions;
}
absl::Span<const FormulaWord> FormulaConstants() {
  return kConstants;
}

}  // namespace touchstone::effects
