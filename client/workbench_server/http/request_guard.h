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

// PERMISSION_DENIED says what is wrong with Host, Origin or Sec-Fetch-Site. `page`: the page itself is asked for, which holds
// nothing that is secret; a browser may be led there from elsewhere, as by the file that --open opens.
absl::Status CheckOrigin(const boost::beast::http::fields& head, bool page);

// The same for the port beside the page's: another port of the same host may ask.
absl::Status CheckOriginBesidePage(const boost::beast::http::fields& head);

// UNAUTHENTICATED where the token is missing or another one.
absl::Status CheckToken(const boost::beast::http::fields& head, const std::string& token);
absl::Status CheckToken(const std::string& shown, const std::string& token);

}  // namespace touchstone::workbench
