#include "server/base/files/file_label.h"

#include <gtest/gtest.h>

namespace touchstone {
namespace {

TEST(FileLabel, IsTheNameWithoutFoldersUnlessTwoFilesShareIt) {
  const std::vector<std::string> paths = {"lab/monday.csv", "lab/friday.csv", "a/set.csv", "b/set.csv",
                                          "stdin"};
  EXPECT_EQ(FileLabel(paths, 0), "monday.csv");
  EXPECT_EQ(FileLabel(paths, 2), "a/set.csv");
  EXPECT_EQ(FileLabel(paths, 3), "b/set.csv");
  EXPECT_EQ(FileLabel(paths, 4), "stdin");
}

}  // namespace
}  // namespace touchstone
