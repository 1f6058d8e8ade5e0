// Whether a call may still act.
#pragma once

#include <functional>

#include <absl/status/status.h>

namespace touchstone::source {

// Asked over and over while a call is worked on, above all while something moves for it. An error ends the
// work, and is what the caller gets: the lease is lost, for instance, or the client is gone. Called from the
// thread that works.
using MotionGuard = std::function<absl::Status()>;

}  // namespace touchstone::source
