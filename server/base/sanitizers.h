// Whether a test runs under a sanitizer, which costs a factor of ten and more: loops that only sharpen a statistic are
// shorter there.
#pragma once

namespace touchstone {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kUnderSanitizers = true;
#else
inline constexpr bool kUnderSanitizers = false;
#endif

}  // namespace touchstone
