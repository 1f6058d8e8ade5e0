// The message that says what a diagnosis of photographs found.
#pragma once

#include "server/diagnosis/images/photograph_diagnosis.h"
#include "server/session/image_set.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::diagnosis::report {

// Fills the fields of photographs, grey levels where those of touches are in us; verdict, model, causes and summary too.
// `report` is empty, or the comparison of the touches of the same session, whose fields of touches stay.
void WritePhotographs(const images::PhotographDiagnosis& diagnosis, const session::ImageSet& set,
                      v1::Report* report);

// A residual as blue (-scale or less), white (0), red (scale or more): width x height x 3.
std::vector<uint8_t> ResidualColours(const std::vector<float>& residual_grey, double scale_grey);

}  // namespace touchstone::diagnosis::report
