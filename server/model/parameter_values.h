// Values of parameters between files and models: one place that checks counts, ranges and sums, and that
// prints an SI value as the number that a person would have written.
#pragma once

#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/types/span.h>

#include "server/base/text/file_number.h"
#include "server/model/model.h"

namespace touchstone::model {

// The values of one parameter: "1.5", or "[0.25, 0, -0.25]".
std::string FileNumbers(const ParameterInfo& parameter, absl::Span<const double> values_si);

// Where the values of parameter `index` begin in the flat array.
int ValueOffset(const Effect& effect, int index, int fingers);

// Checks numbers of a file (how many, finite, within bounds, sum) and converts them to SI. The error begins
// with `what`, the parameter's full name ("tip_radius.radius_mm").
absl::StatusOr<std::vector<double>> ValuesFromFile(const std::string& what, const ParameterInfo& parameter,
                                                   const std::vector<double>& file_values, int fingers);

// A number as a file has it, or the name of a choice. The error says which choices there are.
absl::StatusOr<double> NumberFromText(const ParameterInfo& parameter, absl::string_view text);

// The index of a parameter; an error that proposes one if there is none.
absl::StatusOr<int> FindParameter(const Effect& effect, const std::string& name);

// "tip_radius", or "formula 'lead_screw'".
std::string EffectTitle(const Effect& effect);

// Checks what concerns the model as a whole: number of fingers, spacing, repeated effects.
absl::Status CheckRig(int fingers, double spacing_mm);
absl::Status CheckAddition(const Model& model, const Effect& effect);

inline constexpr int kMaxEffects = 64;
inline constexpr double kMaxSpacingMm = 1000;

}  // namespace touchstone::model
