// What photographs show, in grey levels.
#pragma once

#include "server/diagnosis/report/diagnosis.h"
#include "server/session/images/image_set.h"

namespace touchstone::diagnosis::report {

// All but the summary.
Diagnosis FromPhotographs(const images::PhotographDiagnosis& found, const session::ImageSet& set);

}  // namespace touchstone::diagnosis::report
