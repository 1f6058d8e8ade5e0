// A fitted value as a report states it.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace touchstone::diagnosis::engine {

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
  // Of a value that several kinds of measurement gave together: what each alone would have left, by its name; one that says
  // nothing is not listed.
  std::vector<std::pair<std::string, double>> std_error_alone;
  std::optional<double> before;  // of an effect that the model has: the value there
};

}  // namespace touchstone::diagnosis::engine
