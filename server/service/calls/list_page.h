// Lists in pages, as https://google.aip.dev/158 has them: page_size, page_token, next_page_token.
#pragma once

#include <cstdint>
#include <string>

#include <absl/status/statusor.h>
#include <absl/types/span.h>

namespace touchstone::service {

// A page is full with so many bytes, whatever its entries: clients take answers of 4 MiB unless told otherwise.
inline constexpr size_t kPageBytes = 3 << 20;

// How many entries the answer may have. INVALID_ARGUMENT: a negative page_size.
absl::StatusOr<size_t> PageSize(int32_t page_size, int max_page_size);

// A page_token that no answer gave.
absl::Status WrongPageToken(const std::string& page_token);

// Fills one page with the entries of a list from the first on. add(entry): adds it, and gives its bytes; key_of(entry):
// the token with which the next page goes on behind it. That is a key of the entry, not a place in the list, so that what is
// made or deleted between two pages neither repeats an entry nor hides one. The token is left empty where the list ends.
template <typename Entry, typename Add, typename KeyOf>
void FillPage(absl::Span<const Entry> entries, size_t page_size, Add add, KeyOf key_of,
              std::string* next_page_token) {
  size_t bytes = 0;
  for (size_t k = 0; k < entries.size(); ++k) {
    if (k > 0 && (k >= page_size || bytes >= kPageBytes)) {
      *next_page_token = key_of(entries[k - 1]);
      return;
    }
    bytes += add(entries[k]);
  }
}

}  // namespace touchstone::service
