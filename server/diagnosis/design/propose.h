// Which touches to make next: those that discriminate between explanations that fit the present data equally
// well.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/design/sequential_choice.h"
#include "server/diagnosis/engine/competition/competition.h"
#include "server/diagnosis/touches/observations.h"
#include "server/model/model.h"
#include "server/touch/commanded_touch.h"

namespace touchstone::diagnosis::design {

struct ProposedTouch {
  std::string object;
  touch::CommandedTouch touch;    // no stroke limit
  bool has_session_time = false;  // whether touch.session_time_s matters: the set has one, or a model drifts
  std::string purpose;            // "tells tip_radius from oblique_slip", "learns the values of tip_radius"
  // In standard deviations of the noise: the expected difference between the two models of the purpose; for
  // one model what its values leave open about this touch.
  double separation_sigmas = 0;
  // About how many touches like the proposed ones bring the expected log evidence between the two models to
  // DesignRules::verdict_nats; 0: one model only, or more than anybody would make.
  int touches_to_verdict = 0;
};

// At most `max_touches` touches, most informative first. `models` are fitted to the observations, best first.
//
// T-optimal (Atkinson and Fedorov 1975), one touch after the other: a touch is worth what the best model and
// a competing one predict differently *after* the latter has been fitted again to all data, the new touches
// included; both ways round. A touch that every model can follow is worth nothing. Candidates come from all
// faces of all objects, with tilts up to 40 deg, any turn, and half, once and twice the set's speed; touches
// that end within 1 mm of a sharp edge are left out, since there a small error of the pose decides.
//
// With one model: where its values would be learnt best (D-optimal). Empty if no touch would discriminate:
// then only another kind of measurement does. What a touch leaves to the next one (return_hysteresis) is not
// planned. sigma_s: noise of one finger's time. Deterministic for a seed, whatever the pool.
absl::StatusOr<std::vector<ProposedTouch>> ProposeTouches(
    const touches::Observations& observations,
    const std::vector<engine::ExplanationsLeft::NamedModel>& models, double sigma_s, int max_touches,
    uint64_t seed, ThreadPool* pool);

}  // namespace touchstone::diagnosis::design
