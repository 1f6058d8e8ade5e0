#include "server/touch/commanded_touch.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <cmath>

#include "server/base/status.h"
#include "server/base/text/file_number.h"
#include "server/base/text/text.h"
#include "server/base/touch_limits.h"

namespace touchstone::touch {
namespace {

absl::Status NotUnit(const Eigen::Vector3d& vector, const std::string& field) {
  if (!vector.allFinite())
    return absl::InvalidArgumentError(
        absl::StrCat(field, " = ", VectorText(vector), ": must be finite numbers"));
  return absl::InvalidArgumentError(absl::StrCat(field, " = ", VectorText(vector), " has length ",
                                                 ShortestNumber(vector.norm()),
                                                 ": must be a unit vector (within 0.001)"));
}

absl::Status CheckRange(double value, double lower, double upper, bool open_below, const std::string& field) {
  if (std::isfinite(value) && value <= upper && (open_below ? value > lower : value >= lower))
    return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(field, " = ", ShortestNumber(value), ": must be ",
                                                 open_below ? "above " : "at least ", ShortestNumber(lower),
                                                 " and at most ", ShortestNumber(upper)));
}

}  // namespace

absl::Status MakeExact(CommandedTouch* touch, const std::string& where) {
  const std::string prefix = where.empty() ? "" : absl::StrCat(where, ".");
  if (!touch->target_m.allFinite() || touch->target_m.cwiseAbs().maxCoeff() > kMaxTargetM)
    return absl::InvalidArgumentError(
        absl::StrCat(prefix, "target_m = ", VectorText(touch->target_m),
                     ": must be finite and within 100 m of the object's origin"));
  switch (MakeOrthonormal(&touch->approach, &touch->lateral)) {
    case VectorFlaw::kNone:
      break;
    case VectorFlaw::kApproachLength:
      return NotUnit(touch->approach, prefix + "approach");
    case VectorFlaw::kLateralLength:
      return NotUnit(touch->lateral, prefix + "lateral");
    case VectorFlaw::kNotPerpendicular:
      return absl::InvalidArgumentError(absl::StrCat(
          prefix, "lateral = ", VectorText(touch->lateral),
          " is not perpendicular to approach = ", VectorText(touch->approach), ": their dot product is ",
          ShortestNumber(touch->approach.dot(touch->lateral)), " and must be 0 (within 0.001)"));
  }
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(touch->standoff_m, 0, kMaxStandoffM, false, prefix + "standoff_m"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(touch->speed_m_s, 0, kMaxSpeedMS, true, prefix + "speed_m_s"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(touch->stroke_m, 0, kNoStrokeLimitM, true, prefix + "stroke_m"));
  TOUCHSTONE_RETURN_IF_ERROR(
      CheckRange(touch->session_time_s, 0, kMaxSessionTimeS, false, prefix + "session_time_s"));
  for (const auto& [name, value] : touch->covariates) {
    if (!absl::StartsWith(name, "cov_") || !std::isfinite(value))
      return absl::InvalidArgumentError(
          absl::StrCat(prefix, "covariates['", name, "'] = ", ShortestNumber(value),
                       ": names begin with 'cov_' and values are finite numbers"));
  }
  return absl::OkStatus();
}

}  // namespace touchstone::touch
