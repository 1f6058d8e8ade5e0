// A model of a report as its file: with what it was fitted to, wherever it is saved from.
#pragma once

#include <string>

#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis::report {

// Of the improved model, or of that of one session: the sets that took part, their hashes, and their errors before and after.
std::string ImprovedModelText(const Diagnosis& diagnosis, const model::Model& model);
// Of the model with the formula or the curve of what no effect explains in data[place], `model_with` there; that part's error is
// the one with it, those of others are not known.
std::string SuggestedModelText(const Diagnosis& diagnosis, int place);

}  // namespace touchstone::diagnosis::report
