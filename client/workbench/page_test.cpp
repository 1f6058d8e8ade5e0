#include "client/workbench/page.h"

#include <absl/strings/match.h>
#include <absl/strings/string_view.h>
#include <gtest/gtest.h>

namespace touchstone::workbench {
namespace {

TEST(PageTemplate, HasOnePlaceForDataOrSaysWhyThereIsNoPage) {
  const absl::StatusOr<absl::string_view> page = PageTemplate();
  if (!page.ok()) {
    EXPECT_TRUE(absl::StrContains(page.status().message(), "npm")) << page.status();
    return;
  }
  const size_t mark = page->find(kDataMark);
  ASSERT_NE(mark, absl::string_view::npos);
  EXPECT_EQ(page->find(kDataMark, mark + 1), absl::string_view::npos);
}

TEST(PageTemplate, FetchesNothingAndRunsOnlyItsOwnScript) {
  const absl::StatusOr<absl::string_view> page = PageTemplate();
  if (!page.ok()) GTEST_SKIP() << page.status();
  const absl::string_view head = page->substr(0, page->find("</head>"));
  EXPECT_TRUE(absl::StrContains(head, "default-src 'none'"));
  EXPECT_TRUE(absl::StrContains(head, "script-src 'sha256-"));
  EXPECT_FALSE(absl::StrContains(head, "unsafe-inline"));
  for (const char* trace : {"<link ", "<img ", "@import", " src=\"http"})
    EXPECT_FALSE(absl::StrContains(head, trace)) << trace;
}

}  // namespace
}  // namespace touchstone::workbench
