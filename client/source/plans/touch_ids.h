// The ids under which a physical source journals touches.
#pragma once

#include <cstdint>
#include <string>

#include <absl/status/status.h>

namespace touchstone::client {

// A pure function of session, object and the touch's number in its file, so that a repeated command
// asks for the same touches and gets those that are done from the journal. At most 128 bytes, the same
// in the Python package.
std::string TouchId(const std::string& session, const std::string& object, uint64_t number);

// An id that no other call makes: for touches that are meant to be new whenever the command runs.
std::string NewTouchId(uint64_t number);

// [A-Za-z0-9_.-]{1,64}; the error begins with `where` ("--session").
absl::Status CheckSessionName(const std::string& name, const std::string& where);

// A session's name out of a file's: "out/monday plan.csv" -> "monday-plan"; "default" if nothing is left.
std::string SessionNameOf(const std::string& path);

}  // namespace touchstone::client
