// The dashboard server's language.
#pragma once

#include <string>

#include "tests/rig/controller/machine.h"

namespace touchstone::rig {

inline constexpr char kDashboardBanner[] = "Connected: Universal Robots Dashboard Server";

// The answer to one line, without line end. `quit` is set where the connection ends behind it.
std::string AnswerDashboard(const std::string& line, const std::string& model, Machine* machine, bool* quit);

}  // namespace touchstone::rig
