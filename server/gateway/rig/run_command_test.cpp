#include "server/gateway/rig/run_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

TEST(RunCommand, EndsWithTheGuard) {
  const absl::Status status =
      RunCommand({"sleep", "600"}, 600, [] { return absl::AbortedError("the lease was lost"); });
  EXPECT_EQ(status.code(), absl::StatusCode::kAborted);
}

TEST(RunCommand, EndsAtItsTime) {
  EXPECT_EQ(RunCommand({"sleep", "600"}, 0.05, nullptr).code(), absl::StatusCode::kDeadlineExceeded);
}

}  // namespace
}  // namespace touchstone::gateway
