#include "server/model/fields/user_term_fields.h"

#include <absl/strings/str_cat.h>

namespace touchstone::model {

absl::Status MissingField(absl::string_view kind, absl::string_view field, absl::string_view example) {
  return absl::InvalidArgumentError(
      absl::StrCat(kind, ": '", field, "' is missing; write for example ", example));
}

const char* AddsName(const UserTerm& term) {
  return term.adds_grey ? "grey" : term.adds_time ? "time_us" : "travel_mm";
}

Stage DefaultStage(const UserTerm& term) {
  return term.adds_grey ? Stage::kImageSensor : term.adds_time ? Stage::kSensor : Stage::kMotion;
}

absl::Status UserTermFields::FillTerm(absl::string_view kind, absl::string_view example_name,
                                      UserTerm* term) const {
  if (name.empty()) return MissingField(kind, "name", absl::StrCat("name: ", example_name));
  if (adds.empty()) return MissingField(kind, "adds", "adds: travel_mm (or time_us; grey for photographs)");
  if (adds != "travel_mm" && adds != "time_us" && adds != "grey")
    return absl::InvalidArgumentError(
        absl::StrCat(kind, ": adds is '", adds, "'; it must be travel_mm, time_us or grey"));
  term->name = name;
  term->adds_time = adds == "time_us";
  term->adds_grey = adds == "grey";
  term->stage = DefaultStage(*term);
  if (stage.empty()) return absl::OkStatus();
  if (term->adds_grey) {
    if (stage == StageName(term->stage)) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrCat(
        kind, ": stage is '", stage, "'; what adds grey acts in the image sensor, leave the stage out"));
  }
  for (const Stage candidate : {Stage::kPose, Stage::kContact, Stage::kMotion, Stage::kSensor}) {
    if (stage != StageName(candidate)) continue;
    term->stage = candidate;
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat(kind, ": stage is '", stage, "'; it must be pose, contact, motion or sensor"));
}

}  // namespace touchstone::model
