// The page of the report, built from source/ by Vite and part of this program.
#pragma once

#include <string>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

namespace touchstone::workbench {

// The whole file, with kDataMark once where the data belong: the text of a <script type="application/json">. An error where
// this build has no page; it says why, and how to get one.
absl::StatusOr<absl::string_view> PageTemplate();

inline constexpr absl::string_view kDataMark = "@TOUCHSTONE_DATA@";

// Whom the page may ask: nobody, as a file, or the server that it came from.
enum class PageReach { kNobody, kOwnOrigin };

// The page with these data (JSON) inside. Nothing in them ends the element that holds them.
// `stop_port`: with kOwnOrigin, a second port of this machine that it may ask; 0: none.
absl::StatusOr<std::string> FilledPage(absl::string_view json, PageReach reach, int stop_port = 0);

}  // namespace touchstone::workbench
