// A posterior as reports and requests carry it (v1::ModelPosterior), in the units of files.
#pragma once

#include <google/protobuf/repeated_field.h>

#include "server/uncertainty/budget.h"
#include "server/uncertainty/posterior.h"
#include "touchstone/v1/diagnosis.pb.h"
#include "touchstone/v1/types.pb.h"

namespace touchstone::uncertainty {

v1::ModelPosterior ToMessage(const Posterior& posterior);

// Checks everything: the model's text against its hash, values against the model's. INVALID_ARGUMENT names
// the field.
absl::StatusOr<Posterior> FromMessage(const v1::ModelPosterior& message);

v1::UncertaintyBudget ToMessage(const Budget& budget);

}  // namespace touchstone::uncertainty
