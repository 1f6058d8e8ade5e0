#include "server/base/files/new_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <fstream>
#include <thread>
#include <vector>

#include "server/base/test_folder.h"
#include "server/base/text/text.h"

namespace touchstone {
namespace {

TEST(WriteNewFile, OfManyWritersOneSucceedsAndItsBytesStay) {
  const TestFolder folder;
  for (int round = 0; round < 20; ++round) {
    const std::string path = folder.Path("model" + std::to_string(round));
    std::vector<absl::Status> said(8);
    std::vector<std::thread> writers;
    for (size_t k = 0; k < said.size(); ++k)
      writers.emplace_back(
          [&, k] { said[k] = WriteNewFile(path, std::string(2000, static_cast<char>('a' + k))); });
    for (std::thread& writer : writers) writer.join();
    int written = -1;
    for (size_t k = 0; k < said.size(); ++k) {
      if (said[k].ok()) {
        EXPECT_EQ(written, -1) << "two writers were told that their bytes are kept";
        written = static_cast<int>(k);
      } else {
        EXPECT_EQ(said[k].code(), absl::StatusCode::kAlreadyExists) << said[k];
      }
    }
    ASSERT_NE(written, -1);
    EXPECT_EQ(ReadFile(path).value(), std::string(2000, static_cast<char>('a' + written)));
  }
  EXPECT_EQ(folder.Entries(), 20u) << "drafts stayed";
}

TEST(WriteNewFile, SaysWhereItCannotWrite) {
  const TestFolder folder;
  const absl::Status status = WriteNewFile(folder.Path("absent/model.yaml"), "x");
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(status.message(), testing::HasSubstr("absent/"));
}

TEST(RemoveOldDrafts, TakesWhatIsOldAndADraft) {
  const TestFolder folder;
  for (const char* name : {".m.yaml.1f.draft", ".m.yaml.1f.draft.part", "m.yaml", ".hidden"})
    std::ofstream(folder.Path(name)) << "x";
  RemoveOldDrafts(folder.path(), std::chrono::hours(1));
  EXPECT_EQ(folder.Entries(), 4u);
  RemoveOldDrafts(folder.path(), std::chrono::seconds(0));
  EXPECT_EQ(folder.Entries(), 2u);
  EXPECT_TRUE(std::filesystem::exists(folder.Path("m.yaml")));
}

}  // namespace
}  // namespace touchstone
