// Files that several processes may write at once, under a name that only one of them gets.
#pragma once

#include <chrono>
#include <string>

#include <absl/status/status.h>
#include <absl/strings/string_view.h>

namespace touchstone {

// Writes a file that is whole or absent, and never over one that is there: ALREADY_EXISTS, with the path as its message. Of
// several writers of one name, in whichever processes and containers, one succeeds. It is written beside its place first (UnfinishedPathOf).
absl::Status WriteNewFile(const std::string& path, absl::string_view data);

// Removes what killed writers left in the folder, if it is at least so old: younger drafts may be being written.
void RemoveOldDrafts(const std::string& folder, std::chrono::seconds age);
// The age for that: nobody writes a file for so long.
inline constexpr std::chrono::hours kOldDraft{1};

}  // namespace touchstone
