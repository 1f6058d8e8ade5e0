// TOUCHSTONE_SERVER names the source of every command that could be given --server.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/cli/tests/real_binary_test.h"
#include "client/cli/tests/test_server.h"

namespace touchstone::cli {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kNobody[] = "127.0.0.1:1";  // where no server is

class ServerVariableTest : public RealBinaryTest {
 protected:
  ServerVariableTest() {
    service::ServerOptions options;
    options.supershape_triangles = 500;
    server_ = std::make_unique<TestServer>(options);
  }
  std::string address() const { return server_->address(); }
  std::string Objects(std::vector<std::string> more = {}) {
    more.insert(more.begin(), "objects");
    return Run(more).out;
  }

 private:
  std::unique_ptr<TestServer> server_;
};

TEST_F(ServerVariableTest, IsTheServerOfACommandWithoutOne) {
  const std::string served = Objects({"--server", address()}), here = Objects();
  ASSERT_NE(served, here) << "its shapes are coarser";
  SetServerVariable(address());
  EXPECT_EQ(Objects(), served);
  EXPECT_EQ(Objects({"--server", "none"}), here);
  SetServerVariable("none");
  EXPECT_EQ(Objects(), here);
}

TEST_F(ServerVariableTest, GivesWayToTheOption) {
  SetServerVariable(kNobody);
  const Outcome outcome = Run({"objects", "--server", address()});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
}

TEST_F(ServerVariableTest, IsNamedWhereItsServerDoesNotAnswer) {
  SetServerVariable(kNobody);
  for (const std::vector<std::string>& words : {std::vector<std::string>{"objects"},
                                                {"touch", "lat20", "--approach", "0,0,-1"},
                                                {"session", "list"}}) {
    std::vector<std::string> all = words;
    all.insert(all.end(), {"--wait-s", "0"});
    const Outcome outcome = Run(all);
    EXPECT_EQ(outcome.exit_code, 3) << words[0] << outcome.err;
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("TOUCHSTONE_SERVER"), HasSubstr("--server none"))) << words[0];
  }
}

TEST_F(ServerVariableTest, IsInTheWayOfWhatOnlyThisProcessHasAndSaysHowToGoOn) {
  SetServerVariable(address());
  const Outcome outcome = Run({"objects", "--threads", "1"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("--threads"), HasSubstr("TOUCHSTONE_SERVER"), HasSubstr("--server none")));
  EXPECT_EQ(Run({"objects", "--threads", "1", "--server", "none"}).exit_code, 0);
}

TEST_F(ServerVariableTest, IsLeftAsideByCommandsWithoutAServerAndWhereAFileIsNamed) {
  SetServerVariable(kNobody);
  EXPECT_EQ(Run({"model", "new", "-o", "m.yaml"}).exit_code, 0);
  EXPECT_EQ(Run({"mesh", "supershape", "lat20", "-o", "lat20.off"}).exit_code, 0);
}

TEST_F(ServerVariableTest, IsNoPath) {
  SetServerVariable("/usr/bin/touchstone-server");
  const Outcome outcome = Run({"objects"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("is a path"), HasSubstr("TOUCHSTONE_SERVER_PROGRAM"), Not(HasSubstr("none"))));
}

TEST_F(ServerVariableTest, NamesTheServerOfASessionThatIsVerified) {
  ASSERT_EQ(Run({"plan", "lat20", "--count", "4", "-o", "plan.csv"}).exit_code, 0);
  ASSERT_EQ(Run({"touch", "--plan", "plan.csv", "-o", "set.csv"}).exit_code, 0);
  SetServerVariable(address());
  ASSERT_EQ(Run({"session", "create", "monday", "set.csv"}).exit_code, 0);
  const Outcome stored = Run({"session", "verify", "monday"});
  EXPECT_EQ(stored.exit_code, 0) << stored.err;
  EXPECT_THAT(stored.err, HasSubstr("session 'monday' is whole: 4 touches, 0 pictures"));
  EXPECT_THAT(Run({"session", "verify", "tuesday"}).err, HasSubstr("tuesday"));
}

}  // namespace
}  // namespace touchstone::cli
