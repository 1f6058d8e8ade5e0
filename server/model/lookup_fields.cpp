#include "server/model/lookup_fields.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>

#include "server/base/status.h"
#include "server/base/text.h"
#include "server/model/finger_name.h"

namespace touchstone::model {
namespace {

absl::Status MissingField(absl::string_view what, absl::string_view example) {
  return absl::InvalidArgumentError(
      absl::StrCat("lookup: '", what, "' is missing; write for example ", example));
}

absl::StatusOr<Stage> StageOf(const std::string& text, bool adds_time) {
  if (text.empty()) return adds_time ? Stage::kSensor : Stage::kMotion;
  for (const Stage stage : {Stage::kPose, Stage::kContact, Stage::kMotion, Stage::kSensor})
    if (text == StageName(stage)) return stage;
  return absl::InvalidArgumentError(
      absl::StrCat("lookup: stage is '", text, "'; it must be pose, contact, motion or sensor"));
}

std::string Join(const std::vector<double>& numbers) {
  return absl::StrJoin(numbers, " ", [](std::string* out, double x) { *out += ShortestNumber(x); });
}

}  // namespace

absl::StatusOr<LookupSpec> LookupFields::ToSpec(int fingers) const {
  LookupSpec spec;
  if (name.empty()) return MissingField("name", "name: warm_up");
  if (adds.empty()) return MissingField("adds", "adds: travel_mm (or time_us)");
  if (adds != "travel_mm" && adds != "time_us")
    return absl::InvalidArgumentError(
        absl::StrCat("lookup: adds is '", adds, "'; it must be travel_mm or time_us"));
  if (covariate.empty()) return MissingField("covariate", "covariate: session_time_s");
  if (knots.empty()) return MissingField("knots", "knots: [0, 300, 900]");
  if (values.empty()) return MissingField("values", "values: [0, 0.1, 0.2]");
  spec.name = name;
  spec.adds_time = adds == "time_us";
  TOUCHSTONE_ASSIGN_OR_RETURN(spec.stage, StageOf(stage, spec.adds_time));
  spec.covariate = covariate;
  spec.knots = knots;
  if (values.count("") != 0 && values.size() == 1) {
    spec.values = {values.at("")};
    return spec;
  }
  std::vector<std::string> known;
  for (int i = 0; i < fingers; ++i) {
    known.push_back(FingerName(i, fingers));
    const auto own = values.find(known.back());
    if (own == values.end())
      return absl::InvalidArgumentError(absl::StrCat("lookup: values of finger ", known.back(),
                                                     " are missing; give one list, or one for each of the ",
                                                     fingers, " fingers"));
    spec.values.push_back(own->second);
  }
  for (const auto& [finger, list] : values)
    if (std::find(known.begin(), known.end(), finger) == known.end())
      return absl::InvalidArgumentError(
          absl::StrCat("lookup: values has no finger '", finger, "'; they are ", absl::StrJoin(known, ", ")));
  return spec;
}

std::string LookupDefinition(const LookupSpec& spec) {
  std::string text =
      absl::StrCat("covariate ", spec.covariate, "\nadds ", spec.adds_time ? "time_us" : "travel_mm",
                   "\nstage ", StageName(spec.stage), "\nknots ", Join(spec.knots), "\n");
  for (const std::vector<double>& values : spec.values) absl::StrAppend(&text, "values ", Join(values), "\n");
  return text;
}

std::string LookupInWords(const LookupSpec& spec) {
  return absl::StrCat(spec.adds_time ? "time_us" : "travel_mm", " += curve of ", spec.covariate, " with ",
                      spec.knots.size(), " knots", spec.values.size() > 1 ? ", per finger" : "");
}

}  // namespace touchstone::model
