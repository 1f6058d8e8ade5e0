// The byte vectors of vectors.txt, checked from both ends by means that share nothing with frame.cpp and
// messages.cpp: the fields of every message are listed here a second time, and CRC and COBS are done another
// way. For tests; no heap.
#pragma once

#include <cstddef>
#include <cstdint>

#include "firmware/core/messages.h"

namespace touchstone::firmware {

struct Vector {
  char name[16] = {};
  struct Field {
    char name[16] = {};
    int width_bytes = 0;  // 24: text
    uint64_t value = 0;
    char text[24] = {};
  };
  Field fields[kMaxFingers * 5 + 1];
  int field_count = 0;
  uint8_t frame[192] = {};
  size_t frame_size = 0;
};

// Takes the next vector off the text; false at its end. A line that cannot be read gives a vector
// without a frame.
bool NextVector(const char** text, Vector* vector);

// Null if the fields make this frame and the frame these fields, by the code under test and by the other
// means; else what differs.
const char* CheckVector(const Vector& vector);

}  // namespace touchstone::firmware
