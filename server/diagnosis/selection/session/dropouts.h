// Contacts that were missed: by chance everywhere alike, or with one finger, on one object, on slopes.
#pragma once

#include <string>

#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::selection {

// Where contacts that the model expects are missed more often than elsewhere, and rows without any contact, for
// people; empty: nothing of the kind. `prediction` with details.
std::string DropoutsInWords(const touches::Observations& observations, const touches::Prediction& prediction);

}  // namespace touchstone::diagnosis::selection
