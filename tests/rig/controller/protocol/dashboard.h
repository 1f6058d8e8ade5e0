// The dashboard server's language.
#pragma once

#include <string>

#include "tests/rig/controller/machine/machine.h"

namespace touchstone::rig {

inline constexpr char kDashboardBanner[] = "Connected: Universal Robots Dashboard Server";

// The answer to one line, without line end. `quit` is set where the connection ends behind it.
// `local`: the connection was made while the robot was in local control; it is refused what moves anything until the
// client connects again, as the refusal says.
std::string AnswerDashboard(const std::string& line, const std::string& model, bool local, Machine* machine,
                            bool* quit);

}  // namespace touchstone::rig
