// A fitted value as a report states it.
#pragma once

#include <optional>
#include <string>

namespace touchstone::diagnosis::inference {

// One entry of a parameter, in the unit of files.
struct ParameterEstimate {
  std::string name;  // "radius_mm"
  double value = 0;
  double std_error = 0;
  std::string unit;    // "mm"
  std::string entry;   // finger ("l", "0") or axis ("x") of a parameter with several entries
  std::string object;  // of a value that differs from object to object
  double lower = 0;    // 95 % interval, within the parameter's bounds
  double upper = 0;
  // Of a value that touches and photographs gave together: what either alone would have left; none: it says nothing.
  std::optional<double> std_error_touches, std_error_photographs;
  std::optional<double> before;  // of an effect that the model has: the value there
};

}  // namespace touchstone::diagnosis::inference
