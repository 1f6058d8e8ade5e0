// The wire message of a diagnosis: the same values in its units (us, mm).
#pragma once

#include "server/diagnosis/report/diagnosis.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::diagnosis::report {

v1::Report ToReport(const Diagnosis& diagnosis);

}  // namespace touchstone::diagnosis::report
