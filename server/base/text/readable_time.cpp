#include "server/base/text/readable_time.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <cmath>

#include "server/base/units.h"

namespace touchstone {

TimeUnit UnitOfTime(double time_us) {
  const double size_us = std::abs(time_us);
  if (size_us >= 999.5e3) return {1e-6, "s"};
  if (size_us >= 999.5) return {1e-3, "ms"};
  return {1, "us"};
}

std::string TimeInWords(double time_s) {
  const double time_us = time_s * kMicrosecondsPerSecond;
  const TimeUnit unit = UnitOfTime(time_us);
  if (unit.symbol == std::string("s")) return absl::StrFormat("%.3g s", time_s);
  const double size = std::abs(time_us) * unit.per_us;
  const std::string figures = absl::StrFormat("%.*g", size >= 10 ? 3 : 2, size);
  return absl::StrCat(time_s < 0 ? "-" : "", figures, " ", unit.symbol);
}

}  // namespace touchstone
