// A formula as texts, from a model file or from the command line, before it is checked.
#pragma once

#include <map>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/model/fields/user_term_fields.h"

namespace touchstone::model {

struct FormulaFields : UserTermFields {
  struct Parameter {
    std::string name;
    std::map<std::string, std::string> fields;  // value, unit, min, max
  };
  std::string expression;
  std::vector<Parameter> parameters;

  // Errors name the field that is missing or wrong. Expression and names are checked by the catalogue.
  absl::StatusOr<FormulaSpec> ToSpec() const;
};

}  // namespace touchstone::model
