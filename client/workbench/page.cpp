#include "client/workbench/page.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>

#include "client/workbench/page_bytes.h"
#include "server/base/status.h"
#include "server/base/text/printable.h"

namespace touchstone::workbench {

absl::StatusOr<absl::string_view> PageTemplate() {
  if (kPageBytes[0] != '\0') return absl::string_view(kPageBytes);
  return absl::FailedPreconditionError(absl::StrCat("this build of touchstone has no page: ", kWhyNoPage,
                                                    ". Install nodejs and npm (deploy/setup does), build "
                                                    "again where the npm registry can be reached; until "
                                                    "then --json writes the same report"));
}

absl::StatusOr<std::string> FilledPage(absl::string_view json, PageReach reach, int stop_port) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const absl::string_view page, PageTemplate());
  const size_t mark = page.find(kDataMark);
  std::string head(page.substr(0, mark));
  if (reach == PageReach::kOwnOrigin)
    absl::StrReplaceAll(
        {{"default-src 'none';", absl::StrCat("default-src 'none'; connect-src 'self'",
                                              stop_port == 0 ? ""
                                                             : absl::StrCat(" http://127.0.0.1:", stop_port,
                                                                            " http://localhost:", stop_port),
                                              ";")}},
        &head);
  // "</script>" in a name must not end the element.
  return absl::StrCat(head, absl::StrReplaceAll(EscapeInJson(json), {{"<", "\\u003c"}, {">", "\\u003e"}}),
                      page.substr(mark + kDataMark.size()));
}

}  // namespace touchstone::workbench
