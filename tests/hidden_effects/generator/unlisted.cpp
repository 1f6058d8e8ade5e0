#include "tests/hidden_effects/generator/unlisted.h"

#include <cmath>
#include <stdexcept>

namespace touchstone::hidden {
namespace {

double Square(double x) {
  return x * x;
}

constexpr double kMeanTemperature = 23;

}  // namespace

const std::vector<UnlistedKind>& UnlistedKinds() {
  static const auto* kinds = new std::vector<UnlistedKind>{
      // The middle finger is mounted on a soft joint, which yields in the direction of gravity.
      {"soft_middle",
       [](const FingerState& s, double) { return s.finger == 0 ? s.approach.z() : 0; },
       {"approach_z", "contact_z_mm", "normal_z"}},
      // A lead screw that is not true: periodic in the travel.
      {"lead_screw",
       [](const FingerState& s, double lead) { return std::sin(2 * M_PI * s.travel_mm / lead); },
       {"travel_mm"}},
      // The row of fingers rolls with gravity: across it, as it stands.
      {"gravity_roll", [](const FingerState& s, double) { return s.finger * s.lateral.z(); }, {"lateral_z"}},
      // One finger's cable is dragged along: late in proportion to the height of its contact.
      {"dragged_cable",
       [](const FingerState& s, double) { return s.finger > 0 ? s.contact_mm.z() / 50 : 0; },
       {"contact_z_mm", "approach_z", "normal_z"}},
      // The bar that carries the fingers bends with the temperature of the room.
      {"warm_bar",
       [](const FingerState& s, double) { return s.finger * (s.temperature - kMeanTemperature) / 2; },
       {"cov_temperature"}},
      // The arm's gear sags in the middle of its stroke.
      {"bent_stroke",
       [](const FingerState& s, double) { return Square((s.travel_mm - s.standoff_mm) / 10); },
       {"travel_mm"}},
      // The object tips if it is first touched by the first finger, and not otherwise.
      {"tipping",
       [](const FingerState& s, double) {
         return s.first_finger < 0 && s.finger > s.first_finger ? s.finger - s.first_finger : 0;
       },
       {"first_finger", "first"}},
  };
  return *kinds;
}

const UnlistedKind& FindUnlisted(const std::string& name) {
  for (const UnlistedKind& kind : UnlistedKinds())
    if (kind.name == name) return kind;
  throw std::invalid_argument("no unlisted effect is called " + name);
}

}  // namespace touchstone::hidden
