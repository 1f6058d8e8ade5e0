// The measurement file (format: proto/README.md), as server/session has it: clients and servers read and write it with
// the same code.
#pragma once

#include "server/session/measurement_csv.h"

namespace touchstone::client {

using touchstone::FormatMeasurements;
using touchstone::MeasuredTouch;
using touchstone::MeasurementHeader;
using touchstone::MeasurementRow;
using touchstone::ParseMeasurements;
using touchstone::TimeColumnName;

}  // namespace touchstone::client
