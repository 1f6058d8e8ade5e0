#include "server/model/parameter_values.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::model {
namespace {

// Values that should sum to 0 may miss it by what was lost in writing nine digits.
constexpr double kSumTolerance = 1e-9;

std::string RangeInWords(const ParameterInfo& parameter) {
  const absl::string_view symbol = UnitSymbol(parameter.unit);
  return absl::StrCat(ShortestNumber(parameter.lower), " to ", ShortestNumber(parameter.upper),
                      symbol.empty() ? "" : " ", symbol);
}

std::string ShortList(const std::vector<double>& values) {
  return absl::StrCat(
      "[",
      absl::StrJoin(values, ", ",
                    [](std::string* out, double value) { absl::StrAppendFormat(out, "%.12g", value); }),
      "]");
}

}  // namespace

std::string FileNumbers(const ParameterInfo& parameter, absl::Span<const double> values_si) {
  if (!parameter.choices.empty()) {
    const double last = static_cast<double>(parameter.choices.size()) - 1;
    return parameter.choices[static_cast<size_t>(std::clamp(std::round(values_si.at(0)), 0.0, last))];
  }
  if (parameter.arity == Arity::kScalar) return FileNumber(parameter.unit, values_si.at(0));
  return absl::StrCat("[",
                      absl::StrJoin(values_si, ", ",
                                    [&](std::string* out, double value) {
                                      absl::StrAppend(out, FileNumber(parameter.unit, value));
                                    }),
                      "]");
}

int ValueOffset(const Effect& effect, int index, int fingers) {
  int offset = 0;
  for (int i = 0; i < index; ++i) offset += effect.parameters[i].Count(fingers);
  return offset;
}

absl::StatusOr<std::vector<double>> ValuesFromFile(const std::string& what, const ParameterInfo& parameter,
                                                   const std::vector<double>& file_values, int fingers) {
  const size_t count = parameter.Count(fingers);
  if (file_values.size() != count) {
    const std::string wanted = parameter.arity == Arity::kPerFinger ? absl::StrCat("one per finger, ", count)
                               : parameter.arity == Arity::kVector3 ? "3, for x, y and z"
                               : parameter.arity == Arity::kVector2 ? "2, for x and y"
                                                                    : "1";
    return absl::InvalidArgumentError(absl::StrCat(what, " has ", file_values.size(),
                                                   file_values.size() == 1 ? " value" : " values",
                                                   "; it needs ", wanted));
  }
  std::vector<double> values_si;
  double sum = 0;
  double largest = 0;
  for (const double value : file_values) {
    if (!(value >= parameter.lower && value <= parameter.upper))
      return absl::InvalidArgumentError(
          absl::StrCat(what, " is ", ShortestNumber(value), "; it must lie in ", RangeInWords(parameter)));
    sum += value;
    largest = std::max(largest, std::fabs(value));
    values_si.push_back(value == 0 ? 0.0 : ToSi(parameter.unit, value));
  }
  if (parameter.sum_zero && std::fabs(sum) > kSumTolerance * largest) {
    std::vector<double> centred = file_values;
    for (double& value : centred) value -= sum / centred.size();
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s: the values sum to %.6g and must sum to 0, since only differences between fingers can be "
        "seen; less their mean they are %s",
        what, sum, ShortList(centred)));
  }
  return values_si;
}

absl::StatusOr<double> NumberFromText(const ParameterInfo& parameter, absl::string_view text) {
  const absl::StatusOr<double> number = ParseNumber(text);
  if (parameter.choices.empty()) return number;
  for (size_t choice = 0; choice < parameter.choices.size(); ++choice)
    if (text == parameter.choices[choice] || (number.ok() && *number == static_cast<double>(choice)))
      return static_cast<double>(choice);
  return absl::InvalidArgumentError(
      absl::StrCat("'", text, "' is none of ", absl::StrJoin(parameter.choices, ", ")));
}

absl::StatusOr<int> FindParameter(const Effect& effect, const std::string& name) {
  std::vector<std::string> known;
  for (size_t i = 0; i < effect.parameters.size(); ++i) {
    if (effect.parameters[i].name == name) return static_cast<int>(i);
    known.push_back(effect.parameters[i].name);
  }
  return absl::InvalidArgumentError(
      absl::StrCat(EffectTitle(effect), " has no parameter '", name, "'", DidYouMean(name, known)));
}

std::string EffectTitle(const Effect& effect) {
  if (effect.formula) return absl::StrCat("formula '", effect.formula->name, "'");
  return effect.lookup ? absl::StrCat("lookup '", effect.lookup->name, "'") : effect.name;
}

absl::Status CheckRig(int fingers, double spacing_mm) {
  if (fingers < 1 || fingers > kMaxFingers)
    return absl::InvalidArgumentError(
        absl::StrCat("end_effector.fingers is ", fingers, "; it must lie in 1 to ", kMaxFingers));
  if (!(spacing_mm > 0 && spacing_mm <= kMaxSpacingMm))
    return absl::InvalidArgumentError(absl::StrCat("end_effector.spacing_mm is ", ShortestNumber(spacing_mm),
                                                   "; it must be above 0 and at most ", kMaxSpacingMm,
                                                   " mm"));
  return absl::OkStatus();
}

absl::Status CheckAddition(const Model& model, const Effect& effect) {
  if (model.effects.size() >= kMaxEffects)
    return absl::InvalidArgumentError(absl::StrCat("a model has at most ", kMaxEffects, " effects"));
  for (const EffectInstance& present : model.effects)
    if (EffectTitle(*present.effect) == EffectTitle(effect))
      return absl::AlreadyExistsError(absl::StrCat(
          EffectTitle(effect), " is in the model already; ",
          effect.formula || effect.lookup ? absl::StrCat("give the ", effect.name, " another name")
                                          : "change its values in the file"));
  return absl::OkStatus();
}

}  // namespace touchstone::model
