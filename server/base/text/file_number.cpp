#include "server/base/text/file_number.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <cmath>

#include "server/base/text/text.h"

namespace touchstone {
namespace {

double Number(const std::string& text) {
  const absl::StatusOr<double> value = ParseNumber(text);
  return value.ok() ? *value : NAN;
}

// A number of files with at most 17 digits that reads back to the SI value; empty if there is none.
std::string ExactFileNumber(Unit unit, double value_si) {
  const double near = FromSi(unit, value_si);
  for (int digits = 15; digits <= 17; ++digits) {
    const std::string text = absl::StrFormat("%.*g", digits, near);
    if (ToSi(unit, Number(text)) == value_si) return text;
  }
  // Division and multiplication need not undo each other: a neighbour may.
  for (int steps = 1; steps <= 2; ++steps) {
    for (const double end : {-HUGE_VAL, HUGE_VAL}) {
      double candidate = near;
      for (int step = 0; step < steps; ++step) candidate = std::nextafter(candidate, end);
      const std::string text = absl::StrFormat("%.17g", candidate);
      if (ToSi(unit, Number(text)) == value_si) return text;
    }
  }
  return "";
}

}  // namespace

std::string FileNumber(Unit unit, double value_si) {
  if (value_si == 0) return "0";  // also for -0
  std::string text = ExactFileNumber(unit, value_si);
  if (!text.empty()) return text;
  const double nearest = ToSi(unit, Number(absl::StrFormat("%.17g", FromSi(unit, value_si))));
  text = ExactFileNumber(unit, nearest);
  return text.empty() ? ShortestNumber(FromSi(unit, value_si)) : text;
}

std::string VectorText(const Eigen::Vector3d& value_si, Unit unit) {
  return absl::StrCat("(", FileNumber(unit, value_si.x()), ", ", FileNumber(unit, value_si.y()), ", ",
                      FileNumber(unit, value_si.z()), ")");
}

}  // namespace touchstone
