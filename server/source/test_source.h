// Objects, touches and guards for the tests of sources.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "server/image/normalize/normalize.h"
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

// What Normalize makes of the plain picture that `data` begins with, side x side pixels.
inline image::Image NormalizedOf(const std::string& data, int side) {
  image::Image plain;
  plain.width = plain.height = side, plain.channels = 1;
  plain.pixels.assign(data.begin(), data.begin() + side * side);
  auto normalized = image::Normalize(plain);
  EXPECT_TRUE(normalized.ok() && image::FoundObject(*normalized)) << normalized.status();
  return *std::move(normalized);
}

inline std::string BytesOf(const std::vector<uint8_t>& values) {
  return {values.begin(), values.end()};
}

}  // namespace touchstone::source
