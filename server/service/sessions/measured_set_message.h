// A measured set as touchstone.v1.MeasuredSet.
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "server/session/measurements/measurement_set.h"
#include "touchstone/v1/sessions.pb.h"

namespace touchstone::service {

// Of a set with poses.
v1::MeasuredSet ToProto(const session::MeasurementSet& set);

// INVALID_ARGUMENT, with `origin` and the line that the touch would have in a file, for what no file could hold.
absl::StatusOr<session::MeasurementSet> FromProto(const v1::MeasuredSet& message, const std::string& origin,
                                                  const session::MeasurementLimits& limits = {});

}  // namespace touchstone::service
