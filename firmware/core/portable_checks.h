// Checks of the core that run anywhere: under gtest on the host, and on a Cortex-M4F without any
// library. No heap.
#pragma once

namespace touchstone::firmware {

struct PortableCheck {
  const char* name;
  // Null if it holds, else the place and the condition that does not. `vectors` is the text of vectors.txt.
  const char* (*run)(const char* vectors);
};
extern const PortableCheck kPortableChecks[];
extern const int kPortableCheckCount;

}  // namespace touchstone::firmware
