// A diagnosis of pictures of a board as the wire message: errors in px.
#pragma once

#include "server/diagnosis/boards/board_diagnosis.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::diagnosis::report {

v1::Report WriteBoardReport(const boards::BoardSet& set, const boards::BoardDiagnosis& diagnosis);

}  // namespace touchstone::diagnosis::report
