// What files and reports call a finger.
#pragma once

#include <string>

namespace touchstone::model {

// "l", "m", "r" for three fingers, else "0", "1", ...
inline std::string FingerName(int finger, int fingers) {
  return fingers == 3 ? std::string(1, "lmr"[finger]) : std::to_string(finger);
}

}  // namespace touchstone::model
