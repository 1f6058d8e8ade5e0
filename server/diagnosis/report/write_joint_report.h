// The message that says what touches and photographs of one session show together.
#pragma once

#include <vector>

#include "server/diagnosis/images/photograph_diagnosis.h"
#include "server/diagnosis/joint/shared_effects.h"
#include "server/diagnosis/report/diagnosis.h"
#include "server/session/image_set.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::diagnosis::report {

// What one model leaves of both kinds of data.
struct JointQuality {
  engine::Quality touches;
  engine::Quality photographs;
};

struct JointDiagnosis {
  joint::SharedEffects shared;
  std::vector<JointQuality> shared_quality;              // after each shared step
  Diagnosis touches;                                     // with the shared effects in place
  images::PhotographDiagnosis photographs;               // the same
  JointQuality initial;                                  // of the given model
  std::string model_name, model_hash;                    // its
  std::string improved_model_yaml, improved_model_hash;  // both kinds' effects; empty if nothing changed
};

// One paragraph: what both show together, then each kind.
std::string SummarizeJointly(const JointDiagnosis& diagnosis);

v1::Report ToJointReport(const JointDiagnosis& diagnosis, const session::ImageSet& set);

}  // namespace touchstone::diagnosis::report
