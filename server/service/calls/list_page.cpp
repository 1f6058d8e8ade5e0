#include "server/service/calls/list_page.h"

#include <absl/strings/str_cat.h>

#include <algorithm>

#include "server/session/csv/csv_fields.h"

namespace touchstone::service {

absl::StatusOr<size_t> PageSize(int32_t page_size, int max_page_size) {
  if (page_size < 0)
    return absl::InvalidArgumentError(absl::StrCat("page_size = ", page_size,
                                                   ": 0 (as many as the source gives, ", max_page_size,
                                                   ") or more was expected"));
  return page_size == 0 ? max_page_size : std::min(page_size, max_page_size);
}

absl::Status WrongPageToken(const std::string& page_token) {
  return absl::InvalidArgumentError(absl::StrCat(
      "page_token = '", session::Shown(page_token),
      "' is no token of this list; next_page_token of the page before was expected, or nothing"));
}

}  // namespace touchstone::service
