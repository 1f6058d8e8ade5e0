// The measurement file (format: proto/README.md), as server/session has it: clients and servers read and write it with
// the same code.
#pragma once

#include "server/session/measurements/measurement_csv.h"

namespace touchstone::client {

using touchstone::session::FormatMeasurements;
using touchstone::session::MeasuredTouch;
using touchstone::session::MeasurementHeader;
using touchstone::session::MeasurementRow;
using touchstone::session::ParseMeasurements;
using touchstone::session::TimeColumnName;

}  // namespace touchstone::client
