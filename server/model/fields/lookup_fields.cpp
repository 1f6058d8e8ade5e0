#include "server/model/fields/lookup_fields.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/model/finger_name.h"

namespace touchstone::model {
namespace {

std::string Join(const std::vector<double>& numbers) {
  return absl::StrJoin(numbers, " ", [](std::string* out, double x) { *out += ShortestNumber(x); });
}

}  // namespace

absl::StatusOr<LookupSpec> LookupFields::ToSpec(int fingers) const {
  LookupSpec spec;
  TOUCHSTONE_RETURN_IF_ERROR(FillTerm("lookup", "warm_up", &spec));
  if (covariate.empty()) return MissingField("lookup", "covariate", "covariate: session_time_s");
  if (knots.empty()) return MissingField("lookup", "knots", "knots: [0, 300, 900]");
  if (values.empty()) return MissingField("lookup", "values", "values: [0, 0.1, 0.2]");
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
  std::string text = absl::StrCat("covariate ", spec.covariate, "\nadds ", AddsName(spec), "\nstage ",
                                  StageName(spec.stage), "\nknots ", Join(spec.knots), "\n");
  for (const std::vector<double>& values : spec.values) absl::StrAppend(&text, "values ", Join(values), "\n");
  return text;
}

std::string LookupInWords(const LookupSpec& spec) {
  return absl::StrCat(AddsName(spec), " += curve of ", spec.covariate, " with ", spec.knots.size(), " knots",
                      spec.values.size() > 1 ? ", per finger" : "");
}

}  // namespace touchstone::model
