// For tests: whether p values of many sets under the null hypothesis are uniform.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace touchstone::diagnosis::engine {

// Kolmogorov's distance from the uniform distribution, against what chance exceeds in 1 of 100 cases.
inline void ExpectUniform(std::vector<double> p_values) {
  std::sort(p_values.begin(), p_values.end());
  const double count = static_cast<double>(p_values.size());
  double distance = 0;
  for (size_t i = 0; i < p_values.size(); ++i)
    distance = std::max({distance, std::abs(p_values[i] - static_cast<double>(i) / count),
                         std::abs(p_values[i] - static_cast<double>(i + 1) / count)});
  EXPECT_LT(distance, 1.63 / std::sqrt(count)) << "of " << count << " p values";
}

}  // namespace touchstone::diagnosis::engine
