// Who may ask the workbench: its own page, opened from the address that was printed. Other pages of the same browser, names
// that were made to point at this machine (DNS rebinding) and other users of it may not.
#pragma once

#include <string>

#include <absl/status/status.h>
#include <boost/beast/http/fields.hpp>

namespace touchstone::workbench {

inline constexpr char kTokenHeader[] = "x-touchstone-token";

// 128 random bits, hex.
std::string NewToken();

// PERMISSION_DENIED says what is wrong with Host, Origin or Sec-Fetch-Site.
absl::Status CheckOrigin(const boost::beast::http::fields& head);

// UNAUTHENTICATED where the token is missing or another one.
absl::Status CheckToken(const boost::beast::http::fields& head, const std::string& token);

}  // namespace touchstone::workbench
