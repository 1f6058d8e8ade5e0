// The attributes by which an HDF5 file is found damaged or changed. Internal to session/.
#pragma once

#include <absl/strings/str_cat.h>

#include <map>
#include <string>

#include "server/base/text/text.h"

namespace touchstone::session {

inline constexpr char kChecksum[] = "sha256";      // of a dataset: of its values
inline constexpr char kChecksums[] = "checksums";  // of the root: ChecksumOfAll
inline constexpr size_t kChecksumDigits = 64;

// Of the names of all datasets and their checksums: HDF5 itself would not notice a name that is damaged.
inline std::string ChecksumOfAll(const std::map<std::string, std::string>& checksums) {
  std::string lines;
  for (const auto& [name, checksum] : checksums) absl::StrAppend(&lines, name, " ", checksum, "\n");
  return Sha256Hex(lines);
}

}  // namespace touchstone::session
