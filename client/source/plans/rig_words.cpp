#include "client/source/plans/rig_words.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/strip.h>

namespace touchstone::client {
namespace {

// The value's name without the enum's.
std::string Stripped(const std::string& name, const char* prefix, int number) {
  return name.empty() ? absl::StrCat(number) : std::string(absl::StripPrefix(name, prefix));
}

constexpr const char* kFaces[] = {"", "+x", "-x", "+y", "-y", "+z", "-z"};

}  // namespace

std::string SourceStateWord(v1::SourceState state) {
  return absl::AsciiStrToLower(Stripped(v1::SourceState_Name(state), "SOURCE_STATE_", state));
}

std::string RobotModeWord(v1::RobotMode mode) {
  return Stripped(v1::RobotMode_Name(mode), "ROBOT_MODE_", mode);
}

std::string SafetyModeWord(v1::SafetyMode mode) {
  return Stripped(v1::SafetyMode_Name(mode), "SAFETY_MODE_", mode);
}

std::string MotionPhaseWord(v1::MotionPhase phase) {
  return absl::AsciiStrToLower(Stripped(v1::MotionPhase_Name(phase), "MOTION_PHASE_", phase));
}

std::string CameraKindWord(v1::CameraKind kind) {
  return absl::AsciiStrToLower(Stripped(v1::CameraKind_Name(kind), "CAMERA_KIND_", kind));
}

std::string UpFaceWord(v1::UpFace face) {
  return v1::UpFace_IsValid(face) ? kFaces[face] : "";
}

v1::UpFace UpFaceOf(const std::string& word) {
  for (int face = v1::UP_FACE_PLUS_X; face <= v1::UP_FACE_MINUS_Z; ++face)
    if (word == kFaces[face]) return static_cast<v1::UpFace>(face);
  return v1::UP_FACE_UNSPECIFIED;
}

}  // namespace touchstone::client
