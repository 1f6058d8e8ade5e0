// The motion under way.
#pragma once

#include <limits>
#include <memory>
#include <string>

#include "tests/rig/controller/machine/machine.h"

namespace touchstone::rig {

struct Machine::Motion {
  std::unique_ptr<Path> path;
  const LinePath* line = nullptr;  // the path, if it is straight
  std::unique_ptr<SpeedProfile> profile;
  double speed = 0, acceleration = 0;  // as commanded, before speed scaling
  uint64_t number = 0;                 // of straight motions; 0 for others
  int thread = -1;                     // that commanded it; -1: nobody any more
  bool keeps_going = false;            // speedl: ends only when it is told to
  bool stopping = false;
  double obstacle_at = std::numeric_limits<double>::infinity();
  std::string obstacle;
  double lag_s = 0;  // of the arm behind its target

  // Of the arm, along a line.
  double TipDistance(double time_s) const {
    return profile->LengthAt(time_s - lag_s) * (line ? line->MetresPerLength() : 0);
  }
};

}  // namespace touchstone::rig
