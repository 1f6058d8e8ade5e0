// What pictures of a chessboard show, in px.
#pragma once

#include "server/diagnosis/boards/board_diagnosis.h"
#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis::report {

Diagnosis FromBoards(const boards::BoardDiagnosis& found, const boards::BoardSet& set);

}  // namespace touchstone::diagnosis::report
