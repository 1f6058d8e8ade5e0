// What formulas and lookups share: where their values come from and where they go.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include "server/effects/formula/formula.h"
#include "server/effects/touch_batch.h"
#include "server/model/effect.h"

namespace touchstone::effects {

// time_us can be added in the sensor stage only.
absl::Status CheckAdds(const model::UserTerm& term);

// The variable of this name, if the term's stage knows it already; nullptr for a cov_* column. Errors say "this KIND".
absl::StatusOr<const FormulaVariable*> FindInput(absl::string_view kind, const model::UserTerm& term,
                                                 const std::string& name,
                                                 const std::vector<std::string>& also_known);

// What the simulation must provide for an input of this name.
void AddNeedsOf(const std::string& name, model::EffectNeeds* needs);

// The values of a cov_* column, one per touch. nullptr: these touches lack it; the batch then has an error, which
// names `title`.
const double* ColumnOf(const std::string& name, const std::string& title, TouchBatch* touches);

// Adds `value(finger, touch, &added)`, in mm or us, to every finger that the term's stage acts on. It returns false
// to stop the batch, for which it has set an error.
template <typename Value>
void AddToFingers(const model::UserTerm& term, TouchBatch* touches, Value&& value) {
  const bool pose = term.stage == model::Stage::kPose, sensor = term.stage == model::Stage::kSensor;
  std::vector<double>& target = pose     ? touches->travel_offset_m
                                : sensor ? touches->reported_time_s
                                         : touches->travel_m;
  const double si_factor = term.adds_time ? kSecondsPerMicrosecond : kMetresPerMillimetre;
  for (int finger = 0; finger < touches->fingers(); ++finger) {
    for (int touch = 0; touch < touches->size(); ++touch) {
      const int entry = touches->At(finger, touch);
      if (!pose && std::isnan(touches->travel_m[entry])) continue;
      double added = 0;
      if (!value(finger, touch, &added)) return;
      added *= si_factor;
      if (sensor && !term.adds_time) added *= touches->time_per_travel_s_m[entry];
      target[entry] += added;
    }
  }
}

}  // namespace touchstone::effects
