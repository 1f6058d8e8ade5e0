// What a diagnosis of photographs says in sentences.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/images/photograph_diagnosis.h"
#include "server/session/image_set.h"

namespace touchstone::diagnosis::report {

// One paragraph for people: what is wrong, and what to do. `others_in_place`: effects that were found elsewhere are in the
// model already.
std::string Summarize(const images::PhotographDiagnosis& diagnosis, bool others_in_place = false);

// What limits the report: few pictures, one object, no outline to be seen.
std::vector<std::string> PhotographWarnings(const images::PhotographDiagnosis& diagnosis,
                                            const session::ImageSet& set);

}  // namespace touchstone::diagnosis::report
