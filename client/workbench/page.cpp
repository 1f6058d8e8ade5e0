#include "client/workbench/page.h"

#include <absl/strings/str_cat.h>

#include "client/workbench/page_bytes.h"

namespace touchstone::workbench {

absl::StatusOr<absl::string_view> PageTemplate() {
  if (kPageBytes[0] != '\0') return absl::string_view(kPageBytes);
  return absl::FailedPreconditionError(absl::StrCat("this build of touchstone has no page: ", kWhyNoPage,
                                                    ". Install nodejs and npm (deploy/setup does), build "
                                                    "again where the npm registry can be reached; until "
                                                    "then --json writes the same report"));
}

}  // namespace touchstone::workbench
