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
  std::string stage;  // empty: motion for travel_mm, sensor for time_us

  // Checks the three and writes them to `term`. `kind`: "formula" or "lookup", for errors, which name the field.
  absl::Status FillTerm(absl::string_view kind, absl::string_view example_name, UserTerm* term) const;
};

// "KIND: 'FIELD' is missing; write for example EXAMPLE".
absl::Status MissingField(absl::string_view kind, absl::string_view field, absl::string_view example);

}  // namespace touchstone::model
