// One diagnosis of touches and photographs of one session.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/joint/shared_effects.h"
#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis::report {

// The verdict of both parts of a diagnosis: that which leaves more to do.
engine::Verdict WorseOf(engine::Verdict one, engine::Verdict other);

// Both as they are, each with one entry of data: what either finds stands beside what the other does.
Diagnosis SideBySide(Diagnosis touches, Diagnosis photographs);

// What one model leaves of both kinds of data.
struct JointQuality {
  Quality touches, photographs;
};

struct JointParts {
  joint::SharedEffects shared;
  std::vector<JointQuality> shared_quality;  // after each shared step, as comparisons find it
  Diagnosis touches, photographs;            // with the shared effects in place
  JointQuality initial;                      // of the given model
  std::optional<engine::NothingMissing>
      nothing_missing;                 // likewise, over what was tried on both; none: not assessed
  std::string model_name, model_hash;  // its
};

// All but the improved model: what both show together, then what each kind shows beside that.
Diagnosis Join(JointParts parts);

}  // namespace touchstone::diagnosis::report
