// The evidence of a comparison: measurements, model, meshes and the user's own effects, read and checked.
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "server/diagnosis/diagnose.h"
#include "server/service/core/resources.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::service {

// Whether a set must hold times, or may be a plan.
enum class TimesOfSet { kNeeded, kNotRead };

// The input has a set, images or both. Their objects are looked up among the evidence's own meshes first, then among the server's. Errors
// name the field, or file and line of what was sent.
absl::StatusOr<diagnosis::DiagnosisInput> ReadEvidence(const v1::Evidence& message,
                                                       const Resources& resources,
                                                       TimesOfSet times = TimesOfSet::kNeeded);

// The user's own effects as a model file: `yaml` itself if it is one, else a model file round an effect that
// stands alone as it would under `effects:` ("formula:" and what belongs to it).
std::string AsModelFile(const std::string& yaml);

}  // namespace touchstone::service
