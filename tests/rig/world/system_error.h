// What ends an emulator that the operating system refuses something.
#pragma once

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>

namespace touchstone::rig {

// Throws std::runtime_error with `what` and the meaning of errno.
[[noreturn]] inline void FailWithErrno(const std::string& what) {
  throw std::runtime_error(what + ": " + std::strerror(errno));
}

}  // namespace touchstone::rig
