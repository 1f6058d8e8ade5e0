// A dataset that was interrupted, divided or made elsewhere has the same bytes as one made at once.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>
#include <random>
#include <thread>

#include <nlohmann/json.hpp>

#include "client/cli/tests/real_binary_test.h"
#include "client/cli/tests/test_server.h"
#include "client/source/dataset/dataset_manifest.h"
#include "server/base/files/file_writer.h"
#include "server/base/test_tier.h"
#include "server/base/text/text.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

// The same dataset, three formats: an undisturbed run is what every disturbed one must equal.
class ResumeTest : public RealBinaryTest, public ::testing::WithParamInterface<std::string> {
 protected:
  void SetUp() override {
    if (GetParam() != "webdataset") TOUCHSTONE_SECOND_TIER("repeated: the same over another format");
  }
  // Every file under a folder with the hash of its bytes; dataset.json with its text, for the message.
  std::map<std::string, std::string> Snapshot(const std::string& name) {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(Path(name)))
      if (entry.is_regular_file())
        files[fs::relative(entry.path(), Path(name)).string()] =
            entry.path().extension() == ".json" ? ReadFile(entry.path().string()).value_or("?")
                                                : Sha256HexOfFile(entry.path().string()).value_or("?");
    return files;
  }
  int Shards(const std::string& name) const {
    if (!fs::exists(Path(name))) return 0;
    int shards = 0;
    for (const auto& entry : fs::directory_iterator(Path(name)))
      shards +=
          entry.path().filename().string().rfind("shard-", 0) == 0 && entry.path().extension() != ".part";
    return shards;
  }
  std::vector<std::string> Stream(const std::string& out, std::vector<std::string> more = {}) const {
    std::vector<std::string> arguments = {"stream",       "--to",  GetParam(), "--samples", "6000",
                                          "--shard-size", "250",   "--seed",   "5",         "--objects",
                                          "lat20,lat00",  "--out", out,        "--quiet"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
};

TEST_P(ResumeTest, KilledAtAnyMomentTheResultIsTheSameByteForByte) {
  TOUCHSTONE_SECOND_TIER("repeated: kills at many moments");
  const Outcome whole = Run(Stream("whole"));
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  const auto expected = Snapshot("whole");
  EXPECT_EQ(expected.count("dataset.json"), 1u);

  std::mt19937 random(7);
  int kills_in_the_middle = 0;
  for (int attempt = 0; attempt < 8; ++attempt) {
    const pid_t child = Start(Stream("killed"));
    const int shards = random() % 21;  // of 24
    while (Shards("killed") < shards && !HasEnded(child))
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 5000));
    ::kill(child, SIGKILL);
    if (Wait(child).exit_code == 128 + SIGKILL && Shards("killed") > 0) ++kills_in_the_middle;
    if (attempt % 2 == 1) continue;
    const Outcome rest = Run(Stream("killed"));
    ASSERT_EQ(rest.exit_code, 0) << rest.err;
    ASSERT_EQ(Snapshot("killed"), expected) << "after attempt " << attempt;
    fs::remove_all(Path("killed"));
  }
  EXPECT_GT(kills_in_the_middle, 0) << "no run was slow enough to be killed; the test shows nothing";
}

TEST_P(ResumeTest, InterruptedItSaysHowToResumeAndLeavesNoPart) {
  const pid_t child =
      Start({"stream", "--to", GetParam(), "--samples", "2000000", "--shard-size", "500", "--out", "d"});
  // Until the first shard stands.
  while (Shards("d") == 0 && !HasEnded(child)) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  ::kill(child, SIGINT);
  const Outcome outcome = Wait(child);
  EXPECT_EQ(outcome.exit_code, 130) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("Run the same command again to resume"));
  for (const auto& entry : fs::directory_iterator(Path("d")))
    EXPECT_NE(entry.path().extension(), ".part") << entry.path();
  const auto manifest = nlohmann::json::parse(*ReadFile(Path("d/dataset.json")));
  EXPECT_EQ(manifest["state"], "partial");
  EXPECT_EQ(manifest["shards"].size(), static_cast<size_t>(Shards("d"))) << "every whole shard is listed";
}

TEST_P(ResumeTest, ParallelJobsMakeTheSameDataset) {
  ASSERT_EQ(Run(Stream("whole")).exit_code, 0);
  for (const char* job : {"2/3", "0/3", "1/3"})
    ASSERT_EQ(Run(Stream("jobs", {"--shards", job})).exit_code, 0) << job;
  EXPECT_EQ(Snapshot("jobs"), Snapshot("whole"));
}

TEST_P(ResumeTest, AnotherSpecificationIsRefusedAndNamed) {
  ASSERT_EQ(Run(Stream("d")).exit_code, 0);
  const auto before = Snapshot("d");
  const Outcome other = Run(Stream("d", {"--speed-mm-s", "30"}));
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, AllOf(HasSubstr("specification.plan.speed_mm_s: 20.0 there, 30.0 now"),
                               HasSubstr("--restart")));
  EXPECT_EQ(Snapshot("d"), before);
  EXPECT_EQ(Run(Stream("d", {"--speed-mm-s", "30", "--restart"})).exit_code, 0);
  EXPECT_NE(Snapshot("d"), before);
}

TEST_P(ResumeTest, ADatasetIsMadeAgainFromItsOwnFile) {
  ASSERT_EQ(Run(Stream("d")).exit_code, 0);
  const Outcome again = Run({"stream", "--like", "d/dataset.json", "--out", "again", "--quiet"});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(Snapshot("again"), Snapshot("d"));
}

TEST_P(ResumeTest, AServerGivesTheSameBytesAsThisProcess) {
  const TestServer server;
  ASSERT_EQ(Run(Stream("embedded")).exit_code, 0);
  // The first address never answers.
  const std::string servers = "127.0.0.1:1," + server.address();
  const Outcome remote = Run(Stream("remote", {"--server", servers, "--batch-size", "77"}));
  ASSERT_EQ(remote.exit_code, 0) << remote.err;
  EXPECT_EQ(Snapshot("remote"), Snapshot("embedded"));
}

// The files of a shard: itself, or those in its folder.
std::vector<fs::path> FilesOf(const fs::path& shard) {
  if (!fs::is_directory(shard)) return {shard};
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(shard)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

TEST_P(ResumeTest, AByteThatWasChangedIsFound) {
  ASSERT_EQ(Run(Stream("d")).exit_code, 0);
  const auto expected = Snapshot("d");
  EXPECT_THAT(Run({"dataset", "verify", "d"}).err, HasSubstr("6000 samples in 24 shards, every byte"));
  std::vector<fs::path> shards;
  for (const auto& entry : fs::directory_iterator(Path("d")))
    if (entry.path().filename() != "dataset.json") shards.push_back(entry.path());
  std::sort(shards.begin(), shards.end());
  ASSERT_EQ(shards.size(), 24u);
  const fs::path file = FilesOf(shards[7]).back();
  std::string bytes = *ReadFile(file.string());
  bytes[bytes.size() / 2] ^= 1;
  ASSERT_TRUE(WriteFileAtomically(file.string(), bytes).ok());

  const std::string name = shards[7].filename().string();
  const Outcome verified = Run({"dataset", "verify", "d", "--json"});
  EXPECT_EQ(verified.exit_code, 4) << verified.err;
  EXPECT_THAT(verified.err, AllOf(HasSubstr("23 of 24"), HasSubstr(name + " has the SHA-256")));
  EXPECT_EQ(nlohmann::json::parse(verified.out)["shards_whole"], 23);
  // It does not count as done either, and what is deleted is made again.
  const Outcome resumed = Run(Stream("d"));
  EXPECT_EQ(resumed.exit_code, 2);
  EXPECT_THAT(resumed.err, AllOf(HasSubstr(name), HasSubstr("was changed")));
  fs::remove_all(shards[7]);
  EXPECT_THAT(Run({"dataset", "verify", "d"}).err, HasSubstr("1 shard is missing: " + name));
  EXPECT_EQ(Run(Stream("d")).exit_code, 0);
  EXPECT_EQ(Snapshot("d"), expected);
}

TEST_P(ResumeTest, AShardOfWhichNothingIsKnownIsMadeAgain) {
  ASSERT_EQ(Run(Stream("d")).exit_code, 0);
  const auto expected = Snapshot("d");
  // As after a kill between a shard and the manifest, and a disk that lost the shard's end.
  nlohmann::ordered_json manifest = nlohmann::ordered_json::parse(*ReadFile(Path("d/dataset.json")));
  const fs::path shard = Path("d/" + manifest["shards"][5]["name"].get<std::string>());
  manifest["shards"].erase(5);
  manifest["state"] = "partial";
  ASSERT_TRUE(WriteFileAtomically(Path("d/dataset.json"), manifest.dump()).ok());
  const fs::path file = FilesOf(shard).back();
  fs::resize_file(file, fs::file_size(file) / 2);
  EXPECT_THAT(Run({"dataset", "verify", "d"}).err, HasSubstr("no dataset.json says"));
  EXPECT_EQ(Run(Stream("d")).exit_code, 0);
  EXPECT_EQ(Snapshot("d"), expected);
}

INSTANTIATE_TEST_SUITE_P(Formats, ResumeTest, ::testing::Values("webdataset", "folder", "hdf5"),
                         [](const auto& info) { return info.param; });

}  // namespace
}  // namespace touchstone::cli
