// The states of one approach as a series over time: kept on request.
#pragma once

#include <absl/status/statusor.h>

#include "server/gateway/rig/results/touch_result.h"
#include "touchstone/v1/types.pb.h"

namespace touchstone::gateway {

// Every state of the approach; its times count from where the contact times of ResultOf(record) count from. The same
// errors as ResultOf.
absl::StatusOr<v1::TouchSeries> SeriesOf(const TouchRecording& record);

}  // namespace touchstone::gateway
