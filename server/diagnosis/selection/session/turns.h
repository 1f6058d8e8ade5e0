// Whether touches take turns: the fingers' times depend on the place of a touch in the session modulo a small number. Nothing
// of the object or the arm does that, but electronics that are read in turn, or a tool that is laid down alternately, do.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/engine/competition/result.h"
#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::selection {

// Place of each row of the set in the order of the session.
std::vector<int> PlacesInSession(const session::MeasurementSet& set);

struct Turns {
  int period = 0;        // touches
  double p = 1;          // of so large a gain by chance (F test, all periods)
  double gain_nats = 0;  // of a mean for each finger and place in the turn over one mean (BIC)
  int finger = 0;        // that differs most ...
  double range_s = 0;    // ... by so much between two places in the turn
  std::string words;     // sentences for people
};

// Periods of 2 to 8 touches, of the session's order with touches that are left out counted; `residuals` [k * fingers + i]. Repeats
// of a pose are compared with one another where they have several places in the turn; else poses are, beside what depends on their
// place and direction: touches that go round the faces of an object take turns without any cause. Nothing where no turn is ahead.
std::optional<Turns> FindTurns(const touches::Observations& observations,
                               const std::vector<double>& residuals);

// Puts the place in the turn in front of the covariates.
void NameTurnFirst(const Turns& turns, engine::UnexplainedRest* rest);

}  // namespace touchstone::diagnosis::selection
