#include "server/model/user_term_fields.h"

#include <absl/strings/str_cat.h>

namespace touchstone::model {

absl::Status MissingField(absl::string_view kind, absl::string_view field, absl::string_view example) {
  return absl::InvalidArgumentError(
      absl::StrCat(kind, ": '", field, "' is missing; write for example ", example));
}

absl::Status UserTermFields::FillTerm(absl::string_view kind, absl::string_view example_name,
                                      UserTerm* term) const {
  if (name.empty()) return MissingField(kind, "name", absl::StrCat("name: ", example_name));
  if (adds.empty()) return MissingField(kind, "adds", "adds: travel_mm (or time_us)");
  if (adds != "travel_mm" && adds != "time_us")
    return absl::InvalidArgumentError(
        absl::StrCat(kind, ": adds is '", adds, "'; it must be travel_mm or time_us"));
  term->name = name;
  term->adds_time = adds == "time_us";
  term->stage = term->adds_time ? Stage::kSensor : Stage::kMotion;
  if (stage.empty()) return absl::OkStatus();
  for (const Stage candidate : {Stage::kPose, Stage::kContact, Stage::kMotion, Stage::kSensor}) {
    if (stage != StageName(candidate)) continue;
    term->stage = candidate;
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat(kind, ": stage is '", stage, "'; it must be pose, contact, motion or sensor"));
}

}  // namespace touchstone::model
