// What becomes of the file under the name of an output: what was there before, --force, and what
// is there afterwards.
#include "client/cli/common/output_file.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <future>

#include "server/base/test_folder.h"
#include "server/base/text/text.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class OutputFileTest : public ::testing::Test {
 protected:
  std::string Path(const std::string& name) const { return folder_.Path(name); }

  void Put(const std::string& name, const std::string& text) {
    std::ofstream file(Path(name));
    file << text;
  }
  std::string Get(const std::string& name) const { return ReadFile(Path(name)).value_or("(not there)"); }

  absl::Status Check(const std::string& name, bool force = false, OutputKind kind = OutputKind::kFile) const {
    return CheckOutputFiles({{"-o", Path(name), kind}}, {}, force);
  }
  // As a command does: nothing is written where the check refuses.
  absl::Status CheckAndWrite(const std::string& name, const std::string& data, bool force = false) const {
    const absl::Status checked = Check(name, force);
    return checked.ok() ? WriteOutputFile(Path(name), data, force) : checked;
  }
  // Names in the folder: nothing temporary is left.
  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_.path())) names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());
    return names;
  }
  mode_t ModeOf(const std::string& name) const {
    struct stat info {};
    ::lstat(Path(name).c_str(), &info);
    return info.st_mode;
  }

  TestFolder folder_;
};

TEST_F(OutputFileTest, ANewFileIsMadeWithTheBitsOfTheUmask) {
  const mode_t before = ::umask(0027);
  EXPECT_TRUE(CheckAndWrite("new.csv", "data").ok());
  ::umask(before);
  EXPECT_EQ(Get("new.csv"), "data");
  EXPECT_EQ(ModeOf("new.csv") & 07777, 0640u);
  EXPECT_THAT(Names(), testing::ElementsAre("new.csv"));
}

TEST_F(OutputFileTest, AnExistingFileIsReplacedWithForceOnly) {
  Put("old.csv", "precious");
  const absl::Status refused = CheckAndWrite("old.csv", "data");
  EXPECT_EQ(refused.code(), absl::StatusCode::kAlreadyExists);
  EXPECT_THAT(refused.message(), HasSubstr("--force"));
  EXPECT_EQ(Get("old.csv"), "precious");
  EXPECT_TRUE(CheckAndWrite("old.csv", "data", /*force=*/true).ok());
  EXPECT_EQ(Get("old.csv"), "data");
  EXPECT_THAT(Names(), testing::ElementsAre("old.csv"));
}

TEST_F(OutputFileTest, ALongNameIsWrittenToo) {
  const std::string name = std::string(250, 'n') + ".csv";
  EXPECT_TRUE(CheckAndWrite(name, "data").ok());
  EXPECT_EQ(Get(name), "data");
  EXPECT_FALSE(Check(name + "too_long").ok());
}

TEST_F(OutputFileTest, ForceKeepsThePermissionBits) {
  for (const mode_t mode : {0600u, 0640u, 0755u}) {
    Put("old.csv", "precious");
    ::chmod(Path("old.csv").c_str(), mode);
    ASSERT_TRUE(CheckAndWrite("old.csv", "data", /*force=*/true).ok());
    EXPECT_EQ(ModeOf("old.csv") & 07777, mode);
  }
}

TEST_F(OutputFileTest, WhatAppearsDuringTheWorkIsNotReplacedAndTheWorkIsNotLost) {
  ASSERT_TRUE(Check("result.csv").ok());
  Put("result.csv", "somebody else's");
  const absl::Status status = WriteOutputFile(Path("result.csv"), "hours of work", /*force=*/false);
  ASSERT_EQ(status.code(), absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(Get("result.csv"), "somebody else's");
  const std::string message(status.message());
  EXPECT_EQ(ReadFile(message.substr(message.rfind(' ') + 1)).value_or(""), "hours of work");
}

TEST_F(OutputFileTest, ALinkIsFollowedAndStays) {
  Put("target.csv", "precious");
  fs::create_symlink("target.csv", Path("link.csv"));
  fs::create_symlink("link.csv", Path("link2.csv"));
  EXPECT_EQ(CheckAndWrite("link2.csv", "data").code(), absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(Get("target.csv"), "precious");
  EXPECT_TRUE(CheckAndWrite("link2.csv", "data", /*force=*/true).ok());
  EXPECT_EQ(Get("target.csv"), "data");
  EXPECT_TRUE(S_ISLNK(ModeOf("link.csv")) && S_ISLNK(ModeOf("link2.csv")));
}

TEST_F(OutputFileTest, ALinkToNothingLeadsToTheNewFile) {
  fs::create_symlink("later.csv", Path("link.csv"));
  EXPECT_TRUE(CheckAndWrite("link.csv", "data").ok());
  EXPECT_TRUE(S_ISLNK(ModeOf("link.csv")));
  EXPECT_EQ(Get("later.csv"), "data");
  fs::create_symlink("round", Path("round"));
  EXPECT_EQ(Check("round").code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(OutputFileTest, AFifoIsWrittenIntoAndStays) {
  ASSERT_EQ(::mkfifo(Path("fifo").c_str(), 0600), 0);
  auto reader = std::async(std::launch::async, [&] {
    std::ifstream file(Path("fifo"));
    return std::string(std::istreambuf_iterator<char>(file), {});
  });
  EXPECT_TRUE(CheckAndWrite("fifo", "data").ok());
  EXPECT_EQ(reader.get(), "data");
  EXPECT_TRUE(S_ISFIFO(ModeOf("fifo")));
}

TEST_F(OutputFileTest, ADeviceNodeIsWrittenIntoAndStays) {
  // As /dev/null; only root may make one.
  if (::mknod(Path("null").c_str(), S_IFCHR | 0666, makedev(1, 3)) != 0) GTEST_SKIP() << "needs root";
  for (const bool force : {false, true}) {
    const absl::Status status = CheckAndWrite("null", "data", force);
    if (!status.ok()) GTEST_SKIP() << "device nodes do not work on this file system: " << status;
    EXPECT_TRUE(S_ISCHR(ModeOf("null")));
  }
  fs::create_symlink("null", Path("link"));
  EXPECT_TRUE(CheckAndWrite("link", "data", /*force=*/true).ok());
  EXPECT_TRUE(S_ISCHR(ModeOf("null")) && S_ISLNK(ModeOf("link")));
  EXPECT_TRUE(
      CheckOutputFiles({{"--html", Path("null")}, {"--json", Path("null")}}, {Path("null")}, false).ok())
      << "nothing is lost there";
}

TEST_F(OutputFileTest, ABlockDeviceIsRefused) {
  if (::mknod(Path("disk").c_str(), S_IFBLK | 0666, makedev(7, 250)) != 0) GTEST_SKIP() << "needs root";
  EXPECT_THAT(Check("disk", /*force=*/true).message(), HasSubstr("block device"));
}

TEST_F(OutputFileTest, AnInputIsNeverWrittenByWhateverName) {
  Put("set.csv", "precious");
  fs::create_symlink("set.csv", Path("link.csv"));
  fs::create_hard_link(Path("set.csv"), Path("hard.csv"));
  fs::create_directory(Path("sub"));
  for (const char* name : {"set.csv", "link.csv", "hard.csv", "sub/../set.csv"})
    for (const char* input : {"set.csv", "link.csv", "hard.csv"})
      for (const bool force : {false, true}) {
        const absl::Status status = CheckOutputFiles({{"-o", Path(name)}}, {"", "-", Path(input)}, force);
        EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << name << " of " << input;
        EXPECT_THAT(status.message(), HasSubstr("never changed"));
      }
  EXPECT_EQ(
      CheckOutputFiles({{"-o", Path("set.csv"), OutputKind::kJournal}}, {Path("set.csv")}, false).code(),
      absl::StatusCode::kInvalidArgument);
}

TEST_F(OutputFileTest, TwoOutputsAreTwoFiles) {
  Put("old", "precious");
  fs::create_symlink("new", Path("link"));
  for (const auto& [a, b] : {std::pair{"new", "new"}, {"new", "link"}, {"new", "./new"}, {"old", "old"}}) {
    const absl::Status status =
        CheckOutputFiles({{"--html", Path(a)}, {"--json", Path(b)}}, {}, /*force=*/true);
    EXPECT_THAT(status.message(), HasSubstr("--json and --html: both are")) << a << " and " << b;
  }
  EXPECT_THAT(CheckOutputFiles({{"--html", "-"}, {"--json", "/dev/stdout"}}, {}, true).message(),
              HasSubstr("both are standard output"));
  EXPECT_TRUE(CheckOutputFiles({{"--html", "-"}, {"--json", Path("new")}}, {}, false).ok());
}

TEST_F(OutputFileTest, WhatCannotBeWrittenIsRefusedBeforeTheWork) {
  Put("file", "precious");
  fs::create_directory(Path("folder"));
  for (const char* name : {"folder", "nowhere/x.csv", "file/x.csv", "new/"})
    for (const bool force : {false, true})
      EXPECT_EQ(Check(name, force).code(), absl::StatusCode::kInvalidArgument) << name;
  EXPECT_FALSE(CheckOutputFiles({{"-o", "/proc/x.csv"}}, {}, false).ok()) << "where not even root may";
  EXPECT_TRUE(CheckOutputFiles({{"-o", Path("a/b/x.csv"), OutputKind::kFile, true}}, {}, false).ok());
  if (::geteuid() != 0) {
    ::chmod(Path("folder").c_str(), 0500);
    EXPECT_EQ(Check("folder/x.csv").code(), absl::StatusCode::kInvalidArgument);
    ::chmod(Path("file").c_str(), 0400);
    EXPECT_EQ(Check("file", /*force=*/true).code(), absl::StatusCode::kInvalidArgument);
  }
  EXPECT_EQ(Get("file"), "precious");
}

TEST_F(OutputFileTest, JournalsAndFoldersMayBeThere) {
  Put("session.db", "journal");
  fs::create_directory(Path("data"));
  EXPECT_TRUE(Check("session.db", false, OutputKind::kJournal).ok());
  EXPECT_TRUE(Check("data", false, OutputKind::kFolder).ok());
  EXPECT_TRUE(Check("more/data", false, OutputKind::kFolder).ok());
  EXPECT_FALSE(Check("session.db", false, OutputKind::kFolder).ok());
  EXPECT_FALSE(Check("data", false, OutputKind::kJournal).ok());
  EXPECT_FALSE(CheckOutputFiles({{"--out", "-", OutputKind::kFolder}}, {}, false).ok());
}

TEST_F(OutputFileTest, AFailedWriteLeavesEverythingAsItWas) {
  Put("old.h5", "precious");
  const auto fail = [](const std::string& free_path) {
    std::ofstream(free_path) << "half";
    return absl::DataLossError(free_path + ": broken");
  };
  const absl::Status status = WriteOutputFileBy(Path("old.h5"), /*force=*/true, fail);
  EXPECT_EQ(status.message(), Path("old.h5") + ": broken");
  EXPECT_EQ(Get("old.h5"), "precious");
  EXPECT_THAT(Names(), testing::ElementsAre("old.h5"));
}

TEST_F(OutputFileTest, WhatALibraryWritesTakesTheSameWay) {
  const auto write = [](const std::string& free_path) {
    std::ofstream(free_path) << "data";
    return absl::OkStatus();
  };
  Put("old.h5", "precious");
  ::chmod(Path("old.h5").c_str(), 0600);
  EXPECT_FALSE(WriteOutputFileBy(Path("old.h5"), /*force=*/false, write).ok());
  EXPECT_EQ(Get("old.h5"), "precious");
  EXPECT_TRUE(WriteOutputFileBy(Path("old.h5"), /*force=*/true, write).ok());
  EXPECT_EQ(Get("old.h5"), "data");
  EXPECT_EQ(ModeOf("old.h5") & 07777, 0600u);
  ASSERT_EQ(::mkfifo(Path("fifo").c_str(), 0600), 0);
  auto reader = std::async(std::launch::async, [&] {
    std::ifstream file(Path("fifo"));
    return std::string(std::istreambuf_iterator<char>(file), {});
  });
  EXPECT_TRUE(WriteOutputFileBy(Path("fifo"), /*force=*/false, write).ok());
  EXPECT_EQ(reader.get(), "data");
}

}  // namespace
}  // namespace touchstone::cli
