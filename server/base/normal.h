// The normal quantile that every 95 % interval of the project uses.
#pragma once

namespace touchstone {

// The 97.5 % quantile of the standard normal distribution: a 95 % interval is an estimate plus and minus so
// many standard errors. normal_test.cpp checks it.
inline constexpr double kNormalQuantile975 = 1.959963984540054;

}  // namespace touchstone
