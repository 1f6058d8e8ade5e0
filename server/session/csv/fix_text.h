// What the fixes of measurement files and of image sets share as text.
#pragma once

#include <string>
#include <vector>

#include <absl/strings/string_view.h>

namespace touchstone::session {

// A word for the shell: in quotes where it needs them.
std::string ShellWord(const std::string& word);

// A CSV line's fields with all their bytes. The line was read before, so its quotes are in order.
std::vector<std::string> RawFields(absl::string_view line);

// The lines of a text with their ends.
std::vector<absl::string_view> LinesWithEnds(absl::string_view text);

// "--swap-objects a,b", or "--rename-object a=b" for each.
std::vector<std::string> RenameOptions(const std::vector<std::pair<std::string, std::string>>& renames);

}  // namespace touchstone::session
