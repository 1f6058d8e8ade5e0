// The protocol's enums of a rig in words: lower-case for states, Universal Robots' own for its modes.
#pragma once

#include <string>

#include "touchstone/v1/control.pb.h"
#include "touchstone/v1/rig.pb.h"

namespace touchstone::client {

std::string SourceStateWord(v1::SourceState state);  // "idle", "protective_stop"
std::string RobotModeWord(v1::RobotMode mode);       // "RUNNING"; "12" for a number without a name
std::string SafetyModeWord(v1::SafetyMode mode);     // "NORMAL"
std::string MotionPhaseWord(v1::MotionPhase phase);  // "approach"
std::string CameraKindWord(v1::CameraKind kind);     // "uvc", "folder"
std::string UpFaceWord(v1::UpFace face);             // "+x"; "" if it is unknown
v1::UpFace UpFaceOf(const std::string& word);        // UNSPECIFIED for a word that is none of them

}  // namespace touchstone::client
