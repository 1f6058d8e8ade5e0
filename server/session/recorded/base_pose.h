// A pose of the journal (x, y, z in metres, then the rotation vector in radians; base frame) as the protocol
// writes it.
#pragma once

#include <array>

#include "touchstone/v1/types.pb.h"

namespace touchstone::session {

// An unknown pose, NaN in the journal, is an empty message.
v1::BasePose BasePoseMessage(const std::array<double, 6>& pose);
std::array<double, 6> ParseBasePose(const v1::BasePose& message);

}  // namespace touchstone::session
