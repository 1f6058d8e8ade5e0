#include "server/diagnosis/report/message_parts.h"

namespace touchstone::diagnosis::report {

v1::Report::Verdict ToMessage(selection::Verdict verdict) {
  switch (verdict) {
    case selection::Verdict::kNone:
      return v1::Report::VERDICT_UNSPECIFIED;
    case selection::Verdict::kAdequate:
      return v1::Report::ADEQUATE;
    case selection::Verdict::kWrongValues:
      return v1::Report::WRONG_VALUES;
    case selection::Verdict::kMissingEffects:
      return v1::Report::MISSING_EFFECTS;
    case selection::Verdict::kUnexplained:
      return v1::Report::UNEXPLAINED;
    case selection::Verdict::kCheckData:
      return v1::Report::CHECK_DATA;
    case selection::Verdict::kTooLittleData:
      return v1::Report::TOO_LITTLE_DATA;
  }
  return v1::Report::VERDICT_UNSPECIFIED;
}

const char* ToMessage(selection::EffectScope scope) {
  return scope == selection::EffectScope::kObject ? "object" : "rig";
}

const char* ToMessage(selection::CandidateNote note) {
  switch (note) {
    case selection::CandidateNote::kNone:
      return "";
    case selection::CandidateNote::kInvisible:
      return "this experiment cannot see it";
    case selection::CandidateNote::kNeutral:
      return "fits best where it changes nothing";
    case selection::CandidateNote::kAtBound:
      return "its best value lies at its bound";
    case selection::CandidateNote::kLinearised:
      return "not among the eight most probable; its gain is a linearised prediction";
  }
  return "";
}

}  // namespace touchstone::diagnosis::report
