// The command line as people and scripts meet it: the real binary, its exit codes, words and files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include <nlohmann/json.hpp>

#include "client/cli/tests/real_binary_test.h"
#include "client/cli/tests/test_server.h"
#include "client/source/dataset/measurement_csv.h"
#include "server/base/text/text.h"
#include "server/service/rpc/server.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class CommandLineTest : public RealBinaryTest {};

TEST_F(CommandLineTest, HelpBeginsWithExamples) {
  for (const std::vector<std::string>& command : {std::vector<std::string>{},
                                                  {"objects"},
                                                  {"effects"},
                                                  {"model"},
                                                  {"model", "add"},
                                                  {"plan"},
                                                  {"touch"},
                                                  {"capture"},
                                                  {"stream"},
                                                  {"mesh"},
                                                  {"mesh", "import"},
                                                  {"mesh", "supershape"},
                                                  {"session"},
                                                  {"session", "import"},
                                                  {"session", "export"},
                                                  {"rig"},
                                                  {"rig", "status"},
                                                  {"rig", "stop"},
                                                  {"rig", "home"},
                                                  {"rig", "mount"},
                                                  {"rig", "dry-run"},
                                                  {"rig", "run"},
                                                  {"rig", "photos"},
                                                  {"rig", "calibrate"},
                                                  {"doctor"}}) {
    std::vector<std::string> arguments = command;
    arguments.push_back("--help");
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.exit_code, 0);
    const size_t examples = outcome.out.find("Examples:");
    ASSERT_NE(examples, std::string::npos) << outcome.out;
    EXPECT_LT(examples, outcome.out.find("Usage:"));
    EXPECT_EQ(outcome.err, "");
  }
}

TEST_F(CommandLineTest, AServerThatIsStartingIsWaitedFor) {
  // No port: another process might take it meanwhile.
  service::ServerOptions options;
  options.listen = "unix:" + Path("socket");
  const pid_t child = Start({"objects", "--server", options.listen, "--wait-s", "300"});
  while (Read(".err").find("waiting for " + options.listen) == std::string::npos && !HasEnded(child))
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  auto server = service::Server::Start(options);
  ASSERT_TRUE(server.ok()) << server.status();
  const Outcome outcome = Wait(child);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("lat20"));
}

TEST_F(CommandLineTest, DataGoesToStdoutAsMeasurementFiles) {
  ASSERT_EQ(Run({"plan", "lat20", "--count", "20", "--seed", "3", "-o", "plan.csv"}).exit_code, 0);
  const Outcome outcome = Run({"touch", "--plan", "plan.csv"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto touches = client::ParseMeasurements(outcome.out, "stdout");
  ASSERT_TRUE(touches.ok()) << touches.status();
  ASSERT_EQ(touches->size(), 20u);
  EXPECT_EQ((*touches)[0].time_s.size(), 3u);
  const Outcome json = Run({"touch", "lat20", "--approach", "0,0,-1", "--json"});
  const auto parsed = nlohmann::json::parse(json.out, nullptr, false);
  ASSERT_FALSE(parsed.is_discarded()) << json.out;
  EXPECT_EQ(parsed["touches"][0]["descriptor_us"].size(), 3u);
}

TEST_F(CommandLineTest, AVirtualSourceHasNoRigAndSaysWhatDoesTheSame) {
  const TestServer server;
  const std::string address = server.address();
  ASSERT_EQ(Run({"plan", "lat20", "--count", "2", "-o", "plan.csv"}).exit_code, 0);
  for (const std::vector<std::string>& command : {std::vector<std::string>{"rig", "status"},
                                                  {"rig", "home"},
                                                  {"rig", "dry-run", "plan.csv"},
                                                  {"rig", "run", "plan.csv", "-o", "session.db"}}) {
    std::vector<std::string> arguments = command;
    arguments.insert(arguments.end(), {"--server", address});
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.exit_code, 4) << outcome.err;
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("virtual source"), HasSubstr("touchstone touch --plan")));
  }
  EXPECT_FALSE(fs::exists(Path("session.db")));
  // What touches a rig touches here, with the same options.
  EXPECT_EQ(
      Run({"touch", "--plan", "plan.csv", "--session", "monday", "--take-lease", "--server", address}).out,
      Run({"touch", "--plan", "plan.csv"}).out);
  EXPECT_EQ(Run({"rig", "stop", "--server", address}).exit_code, 0) << "stopping is never refused";
}

TEST_F(CommandLineTest, JournalsAreListedExportedAndReadLikeMeasurementFiles) {
  ASSERT_EQ(
      Run({"plan", "lat20", "--plan", "faces", "--samples-per-face", "3", "--rounds", "2", "-o", "plan.csv"})
          .exit_code,
      0);
  ASSERT_EQ(Run({"touch", "--plan", "plan.csv", "-o", "set.csv"}).exit_code, 0);
  const Outcome import = Run({"session", "import", "set.csv", "-o", "session.db"});
  ASSERT_EQ(import.exit_code, 0) << import.err;
  EXPECT_THAT(import.err, HasSubstr("36 touches"));
  const Outcome list = Run({"session", "list", "session.db", "--json"});
  ASSERT_EQ(list.exit_code, 0) << list.err;
  const auto sessions = nlohmann::json::parse(list.out)["sessions"];
  ASSERT_EQ(sessions.size(), 1u);
  EXPECT_EQ(sessions[0]["name"], "set");
  EXPECT_EQ(sessions[0]["done"], 36);
  const Outcome shown = Run({"session", "show", "session.db"});
  EXPECT_THAT(shown.out, HasSubstr("36 done"));

  ASSERT_EQ(Run({"session", "export", "session.db", "-o", "again.csv"}).exit_code, 0);
  const auto before = client::ParseMeasurements(Read("set.csv"), "set.csv");
  const auto after = client::ParseMeasurements(Read("again.csv"), "again.csv");
  ASSERT_TRUE(before.ok() && after.ok()) << after.status();
  ASSERT_EQ(after->size(), before->size());
  for (size_t row = 0; row < before->size(); ++row) {
    EXPECT_EQ((*after)[row].touch, (*before)[row].touch);
    EXPECT_EQ((*after)[row].commanded.approach().DebugString(),
              (*before)[row].commanded.approach().DebugString());
    for (int finger = 0; finger < 3; ++finger)
      EXPECT_THAT((*after)[row].time_s[finger], testing::NanSensitiveDoubleEq((*before)[row].time_s[finger]));
  }
  const Outcome compare = Run({"compare", "session.db"});
  EXPECT_EQ(compare.exit_code, 0) << compare.err;

  // Two sessions: the user says which.
  EXPECT_EQ(Run({"session", "import", "set.csv", "-o", "session.db"}).exit_code, 2)
      << "a session never changes";
  ASSERT_EQ(Run({"session", "import", "set.csv", "-o", "session.db", "--session", "monday"}).exit_code, 0);
  const Outcome which = Run({"compare", "session.db"});
  EXPECT_EQ(which.exit_code, 2);
  // What is said to be typed works, beside the file that the session came from.
  EXPECT_THAT(which.err, AllOf(HasSubstr("set, monday"),
                               HasSubstr("touchstone session export session.db set -o session_set.csv\n")));
  EXPECT_EQ(Run({"session", "export", "session.db", "set", "-o", "session_set.csv"}).exit_code, 0);
  EXPECT_EQ(Run({"session", "delete", "session.db"}).exit_code, 2);
  EXPECT_EQ(Run({"session", "delete", "session.db", "monday"}).exit_code, 0);
  EXPECT_EQ(Run({"compare", "session.db"}).exit_code, 0);
}

TEST_F(CommandLineTest, ModelFilesAreNeverChanged) {
  ASSERT_EQ(Run({"model", "new", "-o", "nominal.yaml"}).exit_code, 0);
  const std::string before = *ReadFile(Path("nominal.yaml"));
  ASSERT_EQ(Run({"model", "add", "nominal.yaml", "tip_radius", "radius_mm=3", "-o", "tips.yaml"}).exit_code,
            0);
  EXPECT_EQ(Run({"model", "add", "nominal.yaml", "tip_radius", "radius_mm=4", "-o", "tips.yaml"}).exit_code,
            2);
  EXPECT_EQ(
      Run({"model", "add", "nominal.yaml", "tip_radius", "radius_mm=4", "-o", "nominal.yaml", "--force"})
          .exit_code,
      2);
  EXPECT_EQ(*ReadFile(Path("nominal.yaml")), before);
  const Outcome diff = Run({"model", "diff", "nominal.yaml", "tips.yaml"});
  EXPECT_EQ(diff.exit_code, 0);
  EXPECT_THAT(diff.out, AllOf(HasSubstr("tip_radius"), HasSubstr("3")));
  // The effect acts.
  const std::vector<std::string> touch = {"touch", "lat20", "--approach", "-0.6,0,-0.8", "--model"};
  auto nominal = touch, tips = touch;
  nominal.push_back("nominal.yaml");
  tips.push_back("tips.yaml");
  EXPECT_NE(Run(nominal).out, Run(tips).out);
}

constexpr size_t kOutlinePictures = 40, kOutlineSidePx = 48;

// Of the pictures of a folder, those that show the object everywhere.
int PicturesWithoutOutline(const std::string& folder) {
  const std::string npy = *ReadFile(folder + "/shard-000000/mask.npy");
  constexpr size_t kPixels = kOutlineSidePx * kOutlineSidePx;
  int without = 0;
  for (size_t k = 0; k < kOutlinePictures; ++k) {
    const absl::string_view mask =
        absl::string_view(npy).substr(npy.size() - (kOutlinePictures - k) * kPixels, kPixels);
    without += mask.find('\0') == absl::string_view::npos;
  }
  return without;
}

TEST_F(CommandLineTest, PicturesOfADatasetShowTheOutlineOfTheObject) {
  const auto stream = [&](const std::string& folder, std::vector<std::string> more) {
    std::vector<std::string> arguments = {"stream",     "--samples", "40",   "--image", "48x48", "--mask",
                                          "--renderer", "cpu",       "--to", "folder",  "--out", folder};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome.err;
  };
  EXPECT_THAT(stream("far", {}), Not(HasSubstr("outline")));
  EXPECT_EQ(PicturesWithoutOutline(Path("far")), 0);
  EXPECT_THAT(
      stream("near", {"--radius-ratio", "1.05", "--objects", "lat20"}),
      AllOf(HasSubstr("note: the camera of a touch stands where the touch begins, so near to 'lat20'"),
            HasSubstr("most pictures have no outline. --radius-ratio 2.4 or a larger --fov-deg shows all")));
  EXPECT_GT(PicturesWithoutOutline(Path("near")), 30);
  EXPECT_THAT(stream("faces", {"--plan", "faces", "--objects", "lat20"}), HasSubstr("--standoff-mm"));
}

TEST_F(CommandLineTest, AJobThatGetsNoShardSaysWhy) {
  const Outcome outcome = Run({"stream", "--samples", "100", "--shards", "3/4", "--out", "d"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(
      outcome.err,
      HasSubstr("nothing for job 3 of 4: 100 samples make 1 shard of 10000, which go to the jobs from 0 "
                "on. A --shard-size of 25, the same in all jobs, gives each one something"));
}

TEST_F(CommandLineTest, ImagesComeAsFilesInTheShards) {
  const Outcome outcome = Run({"stream", "--samples", "20", "--image", "32x24", "--renderer", "cpu",
                               "--depth", "--mask", "--out", "d"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto manifest = nlohmann::json::parse(*ReadFile(Path("d/dataset.json")));
  EXPECT_EQ(manifest["state"], "complete");
  EXPECT_EQ(manifest["renderer"], "cpu");
  EXPECT_EQ(manifest["shards"][0]["sha256"], *Sha256HexOfFile(Path("d/shard-000000.tar")));
  EXPECT_THAT(
      *ReadFile(Path("d/shard-000000.tar")),
      AllOf(HasSubstr("000019.image.png"), HasSubstr("000019.depth_mm.npy"), HasSubstr("000019.mask.npy")));
  const Outcome capture = Run({"capture", "lat20", "--eye-mm", "300,0,80", "--depth", "--mask", "--renderer",
                               "cpu", "-o", "side.png"});
  ASSERT_EQ(capture.exit_code, 0) << capture.err;
  EXPECT_THAT(*ReadFile(Path("side.png")), StartsWith("\x89PNG"));
  EXPECT_TRUE(fs::exists(Path("side.mask.png")));
  EXPECT_TRUE(fs::exists(Path("side.depth_mm.npy")));
}

TEST_F(CommandLineTest, DoctorSaysWhatRendersAndTheLimits) {
  const Outcome outcome = Run({"doctor"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("Embree"), HasSubstr("EGL"), HasSubstr("Limits")));
  EXPECT_FALSE(nlohmann::json::parse(Run({"doctor", "--json"}).out, nullptr, false).is_discarded());
}

TEST_F(CommandLineTest, MeshesAreMadeImportedAndInspected) {
  ASSERT_EQ(Run({"mesh", "supershape", "lat20", "--triangles", "2000", "-o", "shape.off"}).exit_code, 0);
  EXPECT_EQ(Run({"mesh", "import", "shape.off", "--fit-mm", "80", "-o", "small.obj"}).exit_code, 0);
  const Outcome info = Run({"mesh", "info", "small.obj", "--json"});
  ASSERT_EQ(info.exit_code, 0) << info.err;
  const auto report = nlohmann::json::parse(info.out);
  EXPECT_TRUE(report["closed"].get<bool>());
  const Outcome objects = Run({"objects", "--mesh", "mine=small.obj"});
  EXPECT_THAT(objects.out, HasSubstr("mine"));
  Write("broken.off", "OFF\n3 1 0\n0 0 0\n");
  const Outcome broken = Run({"mesh", "info", "broken.off"});
  EXPECT_EQ(broken.exit_code, 2);
  EXPECT_THAT(broken.err, HasSubstr("broken.off"));
}

}  // namespace
}  // namespace touchstone::cli
