// A formula or a lookup as texts, from a model file or from the command line: the fields that both have.
#pragma once

#include <string>

#include <absl/status/status.h>
#include <absl/strings/string_view.h>

#include "server/model/effect.h"

namespace touchstone::model {

struct UserTermFields {
  std::string name;
  std::string adds;
  std::string stage;  // empty: DefaultStage of what it adds

  // Checks the three and writes them to `term`. `kind`: "formula" or "lookup", for errors, which name the field.
  absl::Status FillTerm(absl::string_view kind, absl::string_view example_name, UserTerm* term) const;
};

// What a term adds, as files write it: "travel_mm", "time_us" or "grey".
const char* AddsName(const UserTerm& term);
// Where it acts if the file does not say: motion, sensor, image sensor.
Stage DefaultStage(const UserTerm& term);

// "KIND: 'FIELD' is missing; write for example EXAMPLE".
absl::Status MissingField(absl::string_view kind, absl::string_view field, absl::string_view example);

}  // namespace touchstone::model
