#include "server/diagnosis/selection/candidates.h"

#include <absl/strings/match.h>
#include <absl/strings/str_join.h>

#include <algorithm>

#include "server/diagnosis/inference/free_model.h"
#include "server/diagnosis/touches/predictor.h"
#include "server/effects/all_effects.h"

namespace touchstone {
namespace {

// What breaks a tie between two effects. Where several rows fit, the first one counts.
struct Tie {
  const char* one;
  const char* other;
  const char* decided_by;
};
constexpr Tie kTies[] = {
    {"channel_latency", "finger_length",
     "Touch again at half and at twice the speed: a latency keeps its time, a length keeps its travel."},
    {"channel_latency", "tool_tilt",
     "Touch again at half and at twice the speed: a latency keeps its time, a tilt keeps its travel."},
    {"speed_error", "clock_skew",
     "Compare with an absolute clock, or with the arm's encoders: only a wrong speed shows there."},
    {"speed_error", "contact_slowdown",
     "Read the arm's speed from its encoders before and after the first contact, or clamp the object and "
     "touch with "
     "one finger: a slowdown begins at the first contact."},
    {"clock_skew", "contact_slowdown",
     "Compare with an absolute clock; or read the arm's speed before and after the first contact."},
    {"object_scale", "speed_error",
     "Measure the object with a caliper, or touch it from the side with a shorter standoff: a wrong scale "
     "moves the "
     "surface, a wrong speed stretches all differences alike."},
    {"gravity_sag", "object_pose",
     "Turn the object upside down: sag stays below, a misplaced object turns along."},
    {"object_push", "contact_slowdown",
     "Clamp the object: a push disappears. Or touch surfaces of larger steps: a slowdown grows with the "
     "gap."},
    {"tip_radius", "oblique_slip",
     "Measure the tips, or touch one flat face at 0 and at 25 deg: balls come early there, slip comes late."},
    {"tool_tilt", "finger_length", "Swap the outer fingers: lengths go with them, a tilt stays."},
    {"tool_tilt", "object_pose", "Turn the object by 90 deg about the approach: a tilt stays with the tool."},
    {"tool_yaw", "object_pose", "Turn the object by 90 deg about the approach: a yaw stays with the tool."},
    {"finger_spacing", "object_scale", "Measure the distance of the outer fingers with a caliper."},
    {"thermal_drift", "finger_length",
     "Pause for an hour with the rig warm and repeat ten touches: only a drift has gone on."},
    {"thermal_drift", "channel_latency",
     "Pause for an hour with the rig warm and repeat ten touches: only a drift has gone on."},
    {"return_hysteresis", "",
     "Repeat one touch after a deep and after a shallow one: only hysteresis remembers which came before."},
    {"surface_error", "", "Turn the object by 180 deg and touch the same places: bumps turn with it."},
};

bool Has(const std::vector<std::string>& effects, const char* name) {
  return std::find(effects.begin(), effects.end(), name) != effects.end();
}

}  // namespace

std::vector<Candidate> MakeCandidates(const DiagnosisInput& input) {
  std::vector<Candidate> candidates;
  const auto has = [&](const std::string& name) {
    return std::any_of(input.model->effects.begin(), input.model->effects.end(),
                       [&](const EffectInstance& instance) { return NameOf(*instance.effect) == name; });
  };
  for (const auto& effect : Catalogue().All()) {
    if (effect->name == "formula" || IsRandomEffect(*effect) || has(effect->name)) continue;
    if (effect->name == "thermal_drift" && !input.set->has_session_time) continue;
    candidates.push_back({effect, effect->always_per_object, false});
    if (input.set->objects.size() > 1 && (effect->name == "object_pose" || effect->name == "object_scale"))
      candidates.push_back({effect, true, false});
  }
  for (const auto& effect : input.also)
    if (!has(NameOf(*effect)) && !IsRandomEffect(*effect)) candidates.push_back({effect, false, true});
  return candidates;
}

std::string DecidedBy(const std::vector<std::string>& effects) {
  for (const Tie& tie : kTies)
    if (Has(effects, tie.one) && (*tie.other == 0 || Has(effects, tie.other))) return tie.decided_by;
  return "Touch at another speed, swap the fingers, or turn the object: whatever differs between " +
         absl::StrJoin(effects, " and ") + " on the rig; `touchstone propose` looks for touches that do.";
}

}  // namespace touchstone
