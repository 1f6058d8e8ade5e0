// The clock of an emulated rig, which the emulator keeps and whoever drives the rig follows: it goes as fast as the
// host's steady clock, but only up to a moment that its keeper moves on, and stands still there. Time in which the
// emulator or its clients waited for the processor does not pass on it.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

namespace touchstone::gateway::timing {

// One keeper sets it, any thread of any process reads it: it may lie in memory that processes share.
class PacedClock {
 public:
  // It shows began_s and what has passed since: since_s at steady_s (host, steady clock), until_s at most.
  struct Course {
    double steady_s = 0, since_s = 0, until_s = 0, began_s = 0;
    double SinceS(double now_steady_s) const;
    // When it stands or will stand still, steady clock.
    double StandsFromS() const { return steady_s + until_s - since_s; }
  };
  void Set(const Course& course);
  Course Get() const;

 private:
  struct Slot {
    std::atomic<double> steady_s{0}, since_s{0}, until_s{0}, began_s{0};
  };
  // The course of version v is in slot v % 2; the next one is written into the other, so that a keeper that is held up
  // while it writes holds up no reader.
  std::atomic<uint64_t> version_{0};
  Slot slots_[2];
};

// In a file that is made, in place of one that is there; throws std::runtime_error.
std::shared_ptr<PacedClock> MakePacedClock(const std::string& file);
absl::StatusOr<std::shared_ptr<const PacedClock>> OpenPacedClock(const std::string& file);

}  // namespace touchstone::gateway::timing
