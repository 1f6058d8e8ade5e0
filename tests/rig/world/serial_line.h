// The serial line between the emulated device and whoever opens its port: a pseudo-terminal under a name that
// stays, and everything that can happen to bytes on the way. Used by one thread.
#pragma once

#include <cstdint>
#include <deque>
#include <random>
#include <string>
#include <vector>

#include "tests/rig/world.h"

namespace touchstone::rig {

class SerialLine {
 public:
  // `link` is a symbolic link that is made, and made anew whenever the line is plugged in again. byte_s:
  // simulated seconds that a byte takes (0: none). Faults: drop_bytes, corrupt_bytes, duplicate_bytes (a
  // byte, either way), line_delay_ms (simulated; bytes never overtake each other). Throws std::runtime_error.
  SerialLine(std::string link, double byte_s, uint64_t seed, const Faults* faults);
  ~SerialLine();
  SerialLine(const SerialLine&) = delete;
  SerialLine& operator=(const SerialLine&) = delete;

  void Plug();    // a new pseudo-terminal; throws std::runtime_error
  void Unplug();  // it vanishes, with all that was under way
  bool plugged() const { return master_ >= 0; }

  // From the device; what finds no room is lost, as on a line without flow control.
  void Write(const uint8_t* bytes, size_t size, double now_s);
  // Moves what is due by now; returns the bytes that reach the device, in order.
  std::vector<uint8_t> Exchange(double now_s);
  // When something is due next, simulated seconds; infinite if nothing is under way.
  double NextDueS() const;
  // Bytes that have arrived for the program that has the port open since it last read everything, also those that have
  // been lost since because it did not.
  size_t Unread();
  int fd() const { return master_; }  // to wait for bytes; -1: unplugged

 private:
  struct Chunk {
    double due_s = 0;
    std::vector<uint8_t> bytes;
  };
  // One direction.
  struct Way {
    std::deque<Chunk> chunks;
    double free_s = 0;  // when the last byte has passed
  };
  size_t Waiting() const;  // for the program that has the port open
  void Send(Way* way, const uint8_t* bytes, size_t size, double now_s);

  std::string link_;
  double byte_s_;
  std::mt19937_64 random_;
  const Faults* faults_;
  int master_ = -1, slave_ = -1;
  size_t lost_bytes_ = 0;
  Way to_device_, from_device_;
};

}  // namespace touchstone::rig
