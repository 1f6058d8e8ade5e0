// Objects, touches and guards for the tests of sources.
#pragma once

#include <gtest/gtest.h>

#include "server/source/source.h"

namespace touchstone::source {

// The built-in supershapes, small.
inline const ObjectStore& SmallObjects() {
  static const ObjectStore* const objects = [] {
    ThreadPool pool(1);
    auto loaded = ObjectStore::Load({}, 2000, &pool);
    EXPECT_TRUE(loaded.ok()) << loaded.status();
    return new ObjectStore(*std::move(loaded));
  }();
  return *objects;
}

inline absl::Status NoObjection() {
  return absl::OkStatus();
}

// Straight down onto the middle of the object, `x_m` beside it.
inline touch::CommandedTouch FromAbove(double x_m = 0) {
  touch::CommandedTouch touch;
  touch.target_m.x() = x_m;
  touch.approach = {0, 0, -1};
  touch.lateral = {1, 0, 0};
  touch.standoff_m = 0.2;
  return touch;
}

}  // namespace touchstone::source
