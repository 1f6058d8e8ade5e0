#include "server/diagnosis/report/message_parts.h"

namespace touchstone::diagnosis::report {

v1::Report::Verdict ToMessage(engine::Verdict verdict) {
  switch (verdict) {
    case engine::Verdict::kNone:
      return v1::Report::VERDICT_UNSPECIFIED;
    case engine::Verdict::kAdequate:
      return v1::Report::ADEQUATE;
    case engine::Verdict::kWrongValues:
      return v1::Report::WRONG_VALUES;
    case engine::Verdict::kMissingEffects:
      return v1::Report::MISSING_EFFECTS;
    case engine::Verdict::kUnexplained:
      return v1::Report::UNEXPLAINED;
    case engine::Verdict::kCheckData:
      return v1::Report::CHECK_DATA;
    case engine::Verdict::kTooLittleData:
      return v1::Report::TOO_LITTLE_DATA;
  }
  return v1::Report::VERDICT_UNSPECIFIED;
}

const char* ToMessage(engine::EffectScope scope) {
  return scope == engine::EffectScope::kObject ? "object" : "rig";
}

const char* ToMessage(engine::CandidateNote note) {
  switch (note) {
    case engine::CandidateNote::kNone:
      return "";
    case engine::CandidateNote::kInvisible:
      return "this experiment cannot see it";
    case engine::CandidateNote::kNeutral:
      return "fits best where it changes nothing";
    case engine::CandidateNote::kAtBound:
      return "its best value lies at its bound";
    case engine::CandidateNote::kLinearised:
      return "not among the eight most probable; its gain is a linearised prediction";
  }
  return "";
}

}  // namespace touchstone::diagnosis::report
