// The normal quantiles of the project's intervals and powers.
#pragma once

namespace touchstone {

// The 97.5 % quantile of the standard normal distribution: a 95 % interval is an estimate plus and minus so
// many standard errors. normal_test.cpp checks it.
inline constexpr double kNormalQuantile975 = 1.959963984540054;

// The 80 % quantile: what is found in 80 % of all cases lies so many standard errors beyond the threshold.
inline constexpr double kNormalQuantile80 = 0.8416212335729143;

}  // namespace touchstone
