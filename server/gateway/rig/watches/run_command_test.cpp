#include "server/gateway/rig/watches/run_command.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>

#include "server/base/test_folder.h"

namespace touchstone::gateway {
namespace {

using testing::HasSubstr;

TEST(RunCommand, WaitsForItsEnd) {
  EXPECT_TRUE(RunCommand({"true"}, 60, nullptr).ok());
}

TEST(RunCommand, TellsTheExitCodeAndTheCommand) {
  const absl::Status status = RunCommand({"sh", "-c", "exit 3"}, 60, nullptr);
  EXPECT_THAT(std::string(status.message()), testing::AllOf(HasSubstr("exit code 3"), HasSubstr("sh -c")));
}

TEST(RunCommand, NamesAProgramThatIsNotThere) {
  EXPECT_THAT(std::string(RunCommand({"no-such-program"}, 60, nullptr).message()),
              HasSubstr("no-such-program"));
}

TEST(RunCommand, ArgumentsAreNotAShells) {
  EXPECT_TRUE(RunCommand({"test", "$(exit 1)", "=", "$(exit 1)"}, 60, nullptr).ok());
}

TEST(RunCommand, BeginsNothingThatItsGuardForbids) {
  const TestFolder folder;
  const std::string made = folder.Path("made");
  const absl::Status status =
      RunCommand({"touch", made}, 600, [] { return absl::AbortedError("the lease was lost"); });
  EXPECT_EQ(status.code(), absl::StatusCode::kAborted);
  EXPECT_FALSE(std::filesystem::exists(made));
}

TEST(RunCommand, EndsWithTheGuardAndSoDoesAllThatItHasStarted) {
  const TestFolder folder;
  const std::string line = folder.Path("line");
  ASSERT_EQ(mkfifo(line.c_str(), 0600), 0);
  const int fd = open(line.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  ASSERT_GE(fd, 0);
  pollfd child{fd, POLLIN, 0};
  // The child of the command holds the other end as long as it lives.
  const absl::Status status =
      RunCommand({"sh", "-c", "(echo begun; exec sleep 600) >\"$1\" & wait", "sh", line}, 600, [&] {
        const bool begun = poll(&child, 1, 0) == 1 && (child.revents & POLLIN) != 0;
        return begun ? absl::AbortedError("the lease was lost") : absl::OkStatus();
      });
  EXPECT_EQ(status.code(), absl::StatusCode::kAborted);
  char text[16];
  EXPECT_GT(read(fd, text, sizeof text), 0);
  EXPECT_EQ(poll(&child, 1, 60'000), 1) << "what the command had started goes on";
  EXPECT_TRUE((child.revents & POLLHUP) != 0);
  close(fd);
}

TEST(RunCommand, EndsAtItsTime) {
  EXPECT_EQ(RunCommand({"sleep", "600"}, 0.05, nullptr).code(), absl::StatusCode::kDeadlineExceeded);
}

}  // namespace
}  // namespace touchstone::gateway
