// For tests: how often a piece stands in a page.
#pragma once

#include <string>

namespace touchstone::client {

inline int Occurrences(const std::string& text, const std::string& piece) {
  int count = 0;
  for (size_t at = text.find(piece); at != std::string::npos; at = text.find(piece, at + 1)) ++count;
  return count;
}

}  // namespace touchstone::client
