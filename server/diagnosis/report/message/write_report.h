// The wire message of a diagnosis: the same values.
#pragma once

#include "server/diagnosis/report/diagnosis.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::diagnosis::report {

// All but what the program adds that was asked: version and provenance.
v1::Report ToReport(const Diagnosis& diagnosis);

}  // namespace touchstone::diagnosis::report
