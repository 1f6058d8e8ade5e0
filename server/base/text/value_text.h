// Numbers in sentences for people: as many digits as they deserve.
#pragma once

#include <string>

namespace touchstone {

// Decimals that show `digits` significant digits of `value`.
int DecimalsFor(double value, int digits);
// With `decimals` decimals; never "-0.0"; "n/a" for NaN.
std::string FixedNumber(double value, int decimals);
// `digits` significant digits, no exponent between 1e-4 and 1e7: "41.0", "0.012", "3e-9"; "n/a" for NaN.
std::string RoundedNumber(double value, int digits);
// A round number as it is: "20", "0.05", "-3e-9".
std::string RoundNumber(double value);

// "2.98 +- 0.02": the error with one digit, or two if that is a 1, and the value with as many decimals, at most seven digits. The
// value alone where the error is 0 or not finite.
std::string ValueWithError(double value, double error);

}  // namespace touchstone
