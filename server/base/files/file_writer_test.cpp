#include "server/base/files/file_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "server/base/files/full_disk.h"
#include "server/base/test_folder.h"
#include "server/base/text/text.h"

namespace touchstone {
namespace {

using testing::HasSubstr;

TEST(WriteFileAtomically, LeavesAWholeFileOrNone) {
  const TestFolder folder;
  const std::string path = folder.Path("atomic.txt");
  ASSERT_TRUE(WriteFileAtomically(path, "hello").ok());
  EXPECT_EQ(ReadFile(path).value(), "hello");
  EXPECT_FALSE(WriteFileAtomically(folder.Path("absent/x"), "hello").ok());
  absl::Status status;
  {
    const FullDisk full;
    status = WriteFileAtomically(path, std::string(100, 'x'));
  }
  EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("atomic.txt: writing failed"));
  EXPECT_EQ(ReadFile(path).value(), "hello");
  EXPECT_EQ(folder.Entries(), 1u) << "what was not finished stayed";
}

TEST(FileWriter, WritesThroughNoLinkAndOverNoFile) {
  const TestFolder folder;
  std::ofstream(folder.Path("of another")) << "kept";
  std::filesystem::create_symlink(folder.Path("of another"), folder.Path("link"));
  std::filesystem::create_symlink(folder.Path("absent"), folder.Path("dangling"));
  for (const char* name : {"of another", "link", "dangling"})
    EXPECT_FALSE(FileWriter::Create(folder.Path(name)).ok()) << name;
  EXPECT_EQ(ReadFile(folder.Path("of another")).value(), "kept");
  EXPECT_FALSE(std::filesystem::exists(folder.Path("absent")));
}

TEST(FileWriter, RemovesWhatWasNotClosed) {
  const TestFolder folder;
  {
    const auto file = FileWriter::Create(folder.Path("a"));
    ASSERT_TRUE(file.ok() && (*file)->Write("half").ok());
    EXPECT_EQ(folder.Entries(), 1u);
  }
  EXPECT_EQ(folder.Entries(), 0u);
}

TEST(FileWriter, ReadsBackWhatItWroteAnywhereAndZerosBeyond) {
  const TestFolder folder;
  const auto file = FileWriter::Create(folder.Path("a"));
  ASSERT_TRUE((*file)->WriteAt(3, "de").ok());
  std::string bytes(7, '?');
  ASSERT_TRUE((*file)->ReadAt(0, bytes.data(), bytes.size()).ok());
  EXPECT_EQ(bytes, std::string("\0\0\0de\0\0", 7));
}

}  // namespace
}  // namespace touchstone
