// A lookup as texts and numbers, from a model file or from the command line, before it is checked.
#pragma once

#include <map>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/model/fields/user_term_fields.h"

namespace touchstone::model {

struct LookupFields : UserTermFields {
  std::string covariate;
  std::vector<double> knots;
  std::map<std::string, std::vector<double>> values;  // by finger name; "" alone: of every finger

  // Errors name the field that is missing or wrong. The covariate is checked by the catalogue.
  absl::StatusOr<LookupSpec> ToSpec(int fingers) const;
};

// Everything that a lookup is made of but its name, in one canonical text: equal curves, equal text.
std::string LookupDefinition(const LookupSpec& spec);

// "travel_mm += curve of session_time_s with 12 knots, per finger".
std::string LookupInWords(const LookupSpec& spec);

}  // namespace touchstone::model
