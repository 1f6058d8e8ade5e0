// Commands whose work is done in Python. A module in the test's folder stands in for the one of the package and says what it
// was given; client/python/tests run the real ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include "client/cli/tests/real_binary_test.h"

namespace touchstone::cli {
namespace {

using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class PythonCommandTest : public RealBinaryTest {
 protected:
  void SetUp() override {
    std::filesystem::create_directory(Path("touchstone"));
    Write("touchstone/__init__.py", "");
    Module("import sys\nprint(sys.argv[1:])\n");
    ::setenv("PYTHONPATH", Path("").c_str(), 1);
    ::setenv("TOUCHSTONE_PYTHON", "/usr/bin/python3", 1);
  }
  void TearDown() override {
    ::setenv("PATH", path_.c_str(), 1);
    for (const char* name : {"PYTHONPATH", "TOUCHSTONE_PYTHON"}) ::unsetenv(name);
  }

  void Module(const std::string& text) { Write("touchstone/formats.py", text); }

 private:
  const std::string path_ = std::getenv("PATH");
};

TEST_F(PythonCommandTest, TheModuleGetsEveryWord) {
  EXPECT_EQ(Run({"export", "a b", "--to", "parquet", "--", "--json", "session"}).out,
            "['export', 'a b', '--to', 'parquet', '--', '--json', 'session']\n");
  EXPECT_EQ(Run({"import"}).out, "['import']\n");
}

TEST_F(PythonCommandTest, TheModuleFindsTheServerOfThisProgram) {
  Module("import os\nprint(os.environ.get('TOUCHSTONE_SERVER_PROGRAM'))\n");
  ::unsetenv("TOUCHSTONE_SERVER_PROGRAM");
  EXPECT_THAT(Run({"export"}).out, ::testing::EndsWith("/bin/touchstone-server\n"));
  ::setenv("TOUCHSTONE_SERVER_PROGRAM", "/another/server", 1);
  EXPECT_EQ(Run({"export"}).out, "/another/server\n");
  ::unsetenv("TOUCHSTONE_SERVER_PROGRAM");
}

TEST_F(PythonCommandTest, HelpIsThatOfTheModule) {
  EXPECT_EQ(Run({"export", "--help"}).out, "['export', '--help']\n");
  EXPECT_EQ(Run({"help", "export"}).out, "['export', '--help']\n");
}

TEST_F(PythonCommandTest, TheExitCodeIsThatOfTheModule) {
  Module("import sys\nsys.exit(7)\n");
  EXPECT_EQ(Run({"export"}).exit_code, 7);
}

TEST_F(PythonCommandTest, ItIsListedSuggestedAndCompleted) {
  EXPECT_THAT(Run({"help"}).out, ContainsRegex("  export +Writes a dataset or a session"));
  EXPECT_THAT(Run({"exprot"}).err, HasSubstr("did you mean 'export'?"));
  EXPECT_THAT(Run({"completion", "bash"}).out, HasSubstr("' import') commands='' options='--map "));
}

TEST_F(PythonCommandTest, InterruptionEndsTheModule) {
  Module("import signal\nopen('started', 'w').close()\nwhile True:\n    signal.pause()\n");
  ::signal(
      SIGINT,
      SIG_DFL);  // which tests that a shell runs in the background would ignore, and the module with them
  for (const int signal : {SIGINT, SIGTERM}) {
    std::filesystem::remove(Path("started"));
    const pid_t child = Start({"export"});
    while (!std::filesystem::exists(Path("started")) && !HasEnded(child))
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    ::kill(child, signal);
    const Outcome outcome = Wait(child);
    EXPECT_EQ(outcome.exit_code, 130);
    EXPECT_EQ(outcome.err, "");
  }
}

TEST_F(PythonCommandTest, AMissingPackageIsNamedWithTheCommandThatInstallsIt) {
  Write("touchstone/__init__.py", "import grpc.of_no_kind\n");
  Write("grpc.py", "");
  Outcome outcome = Run({"export"});
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_THAT(outcome.err,
              AllOf(StartsWith("touchstone: error: touchstone export needs the Python package grpcio"),
                    HasSubstr("/usr/bin/python3 -m pip install 'grpcio'")));
  std::filesystem::remove_all(Path("touchstone"));
  outcome = Run({"export"});
  EXPECT_EQ(outcome.exit_code, 4);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("(no module touchstone)"), HasSubstr("TOUCHSTONE_PYTHON"),
                                 HasSubstr("/usr/bin/python3 -m pip install 'touchstone-sim[formats]'")));
}

TEST_F(PythonCommandTest, FilesAtHandAreNoModules) {
  ::unsetenv("PYTHONPATH");
  EXPECT_THAT(Run({"export"}).err, HasSubstr("(no module touchstone)"));
}

TEST_F(PythonCommandTest, AMissingInterpreterIsSaid) {
  ::setenv("TOUCHSTONE_PYTHON", "/nowhere/python", 1);
  Outcome outcome = Run({"export"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("TOUCHSTONE_PYTHON: '/nowhere/python' is no program"));
  ::unsetenv("TOUCHSTONE_PYTHON");
  ::setenv("PATH", "/nowhere", 1);
  outcome = Run({"export"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("touchstone export runs in Python: python3 is not in PATH"));
}

}  // namespace
}  // namespace touchstone::cli
