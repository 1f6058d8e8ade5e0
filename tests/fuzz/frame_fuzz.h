// What must hold on any line, however damaged, between a host and the end effector's core.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace touchstone::fuzz {

struct Counts {
  uint64_t inputs = 0;          // whole conversations or inputs
  uint64_t damaged_frames = 0;  // pieces that the parsers turned down
  uint64_t good_frames = 0;     // undamaged ones that came through
  uint64_t slipped_frames = 0;  // damaged, yet with a right CRC-16: stopped by the CRC-32
  uint64_t events = 0;          // that a host accepted
};

// Any bytes, to both ends: what is decoded encodes to the same bytes again, and what the device answers is
// well-formed. An empty text if so.
std::string CheckBytes(const uint8_t* data, size_t size, Counts* counts);

// A conversation of a host with the core about random touches, both directions damaged in random ways
// drawn from `seed`: whatever is accepted at either end was sent, and every contact time is that of an
// edge that happened.
std::string CheckConversation(uint64_t seed, Counts* counts);

}  // namespace touchstone::fuzz
