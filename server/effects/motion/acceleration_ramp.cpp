// Acceleration ramp: the arm starts at rest and accelerates constantly up to its speed.
//   t = sqrt(2 d / acc) while d < v^2 / (2 acc), then t = d / v + v / (2 acc)      (touch/motion.cpp)
// No ramp is an infinite acceleration; files write the upper bound for it, and from there on the effect is
// off.
#include "server/effects/define_effect.h"

namespace touchstone::effects {
namespace {

constexpr double kNoRampMmS2 = 1e6;

struct Parameters {
  double acceleration_m_s2;
};

constexpr ParameterRow<Parameters> kRows[] = {
    {&Parameters::acceleration_m_s2, "acceleration_mm_s2", Unit::kMillimetrePerSecondSquared, 1, kNoRampMmS2,
     kNoRampMmS2, 100, "Acceleration from rest up to the speed; 1000000 stands for no ramp at all.",
     /*sum_zero=*/false, /*reciprocal=*/true},
};

void Apply(const Parameters& p, TouchBatch& touches) {
  if (p.acceleration_m_s2 < ToSi(Unit::kMillimetrePerSecondSquared, kNoRampMmS2))
    touches.acceleration_m_s2 = p.acceleration_m_s2;
}

}  // namespace

model::Effect AccelerationRamp() {
  return DefineEffect<Parameters>({
      .name = "acceleration_ramp",
      .stage = model::Stage::kMotion,
      .meaning = "The arm starts at rest and needs a distance v^2 / (2 a) to reach its speed.",
      .signature =
          "Time differences are stretched on touches whose contact comes early in the travel; once all "
          "contacts come after the ramp, all fingers are late alike and nothing shows. Look at the error "
          "against the standoff.",
      .check_on_rig = "Repeat a touch with a much longer standoff: the error disappears.",
      .remedy = "Start farther away, command a higher acceleration, or keep the effect.",
      .rows = kRows,
      .apply = Apply,
  });
}

}  // namespace touchstone::effects
