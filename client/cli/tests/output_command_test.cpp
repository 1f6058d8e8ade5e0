// Nothing of the user's is destroyed: every command that writes a file, against every kind of thing that may
// stand under that name. The real binary.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <future>
#include <map>
#include <ostream>
#include <set>
#include <sstream>

#include "client/cli/tests/real_binary_test.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

struct OutputCase {
  std::string name;
  std::vector<std::string> words;   // OUT: the output's path
  std::string ending;               // of the output's name
  std::vector<std::string> inputs;  // words that are files which the command reads
  bool runs = true;                 // here, without a rig
  bool stdout_works = true;         // `-` is standard output
};
void PrintTo(const OutputCase& output, std::ostream* stream) {
  *stream << output.name;
}

// A server that is not there: what is refused is refused before anybody is asked.
constexpr char kNowhere[] = "127.0.0.1:1";

std::vector<OutputCase> Cases() {
  return {
      {"Plan", {"plan", "lat20", "--count", "2", "-o", "OUT"}, ".csv", {}},
      {"PlanOfFile", {"plan", "lat20", "--plan", "plan.csv", "-o", "OUT"}, ".csv", {"plan.csv"}},
      {"PlanAsJson", {"plan", "lat20", "--count", "2", "--json", "-o", "OUT"}, ".json", {}},
      {"Touch",
       {"touch", "--plan", "plan.csv", "--model", "./model.yaml", "-o", "OUT"},
       ".csv",
       {"plan.csv", "./model.yaml"}},
      {"TouchOfMesh",
       {"touch", "mine", "--mesh", "mine=mine.off", "--approach", "0,0,-1", "-o", "OUT"},
       ".csv",
       {"mine.off"}},
      {"Capture",
       {"capture", "lat20", "--eye-mm", "300,0,80", "--image", "16x16", "--renderer", "cpu", "-o", "OUT"},
       ".png",
       {}},
      {"ModelNew", {"model", "new", "-o", "OUT"}, ".yaml", {}},
      {"ModelAdd",
       {"model", "add", "./model.yaml", "tip_radius", "radius_mm=3", "-o", "OUT"},
       ".yaml",
       {"./model.yaml"}},
      {"ModelRemove",
       {"model", "remove", "./tips.yaml", "tip_radius", "-o", "OUT"},
       ".yaml",
       {"./tips.yaml"}},
      {"MeshImport", {"mesh", "import", "mine.off", "-o", "OUT"}, ".off", {"mine.off"}},
      {"MeshCorrect",
       {"mesh", "correct", "mine.off", "--map", "map.csv", "-o", "OUT"},
       ".off",
       {"mine.off", "map.csv"}},
      {"MeshSupershape", {"mesh", "supershape", "lat20", "--triangles", "200", "-o", "OUT"}, ".off", {}},
      {"CompareAsJson",
       {"compare", "set.csv", "--model", "./model.yaml", "--json", "OUT"},
       ".json",
       {"set.csv", "./model.yaml"}},
      {"CompareAsHtml",
       {"compare", "session.db", "--model", "./model.yaml", "--html", "OUT"},
       ".html",
       {"session.db"}},
      {"DiagnoseAsJson", {"diagnose", "set.csv", "--json", "OUT"}, ".json", {"set.csv"}, false},
      {"DiagnoseAsHtml", {"diagnose", "set.csv", "--html", "OUT"}, ".html", {"set.csv"}, false},
      {"DiagnoseSavesModel",
       {"diagnose", "set.csv", "--model", "./model.yaml", "--also", "also.yaml", "--save-model", "OUT"},
       ".yaml",
       {"set.csv", "./model.yaml", "also.yaml"},
       false},
      {"CheckAsJson", {"check", "set.csv", "--json", "OUT"}, ".json", {"set.csv"}, false},
      {"CheckAsHtml", {"check", "set.csv", "--html", "OUT"}, ".html", {"set.csv"}, false},
      {"CheckImproves",
       {"check", "set.csv", "--improve", "2", "--find", "tip_radius", "-o", "OUT"},
       ".csv",
       {"set.csv"},
       false},
      {"ExplainAsJson", {"explain", "tip_radius", "set.csv", "--json", "OUT"}, ".json", {"set.csv"}, false},
      {"UncertaintyAsJson",
       {"uncertainty", "report.json", "set.csv", "--json", "OUT"},
       ".json",
       {"report.json", "set.csv"},
       false},
      {"ModelPromote",
       {"model", "promote", "tips.yaml", "--over", "./model.yaml", "--on", "set.csv", "-o", "OUT"},
       ".yaml",
       {"tips.yaml", "./model.yaml", "set.csv"},
       false},
      {"ModelDemote", {"model", "demote", "tips.yaml", "-o", "OUT"}, ".yaml", {"tips.yaml"}, false},
      {"HistoryAsJson", {"history", ".", "--json", "OUT"}, ".json", {}, false},
      {"HistoryAsHtml", {"history", ".", "--html", "OUT"}, ".html", {}, false},
      {"RehearseAsJson", {"rehearse", "set.csv", "--json", "OUT"}, ".json", {"set.csv"}, false},
      {"Propose", {"propose", "set.csv", "-o", "OUT"}, ".csv", {"set.csv"}, false},
      {"ProposeAsJson", {"propose", "set.csv", "--json", "OUT"}, ".json", {"set.csv"}, false},
      {"SessionExport", {"session", "export", "session.db", "-o", "OUT"}, ".csv", {"session.db"}},
      {"SessionFix",
       {"session", "fix", "set.csv", "--swap-fingers", "l,m", "-o", "OUT"},
       ".csv",
       {"set.csv"}},
      {"SessionExportHdf5",
       {"session", "export", "session.db", "-o", "OUT"},
       ".h5",
       {"session.db"},
       true,
       false},
      {"RigBundle", {"rig", "bundle", "--journal", "session.db", "-o", "OUT"}, ".tar.gz", {"session.db"}},
      {"RigDryRun",
       {"rig", "dry-run", "plan.csv", "-o", "OUT", "--server", kNowhere, "--wait-s", "0"},
       ".svg",
       {"plan.csv"},
       false},
      {"RigRun",
       {"rig", "run", "plan.csv", "-o", "OUT", "--server", kNowhere, "--wait-s", "0"},
       ".csv",
       {"plan.csv"},
       false},
      {"RigTeach", {"rig", "teach", "-o", "OUT", "--server", kNowhere, "--wait-s", "0"}, ".csv", {}, false},
      {"RigCalibrateFlat",
       {"rig", "calibrate", "flat", "--from", "session.db", "-o", "OUT"},
       ".yaml",
       {"session.db"},
       false},
      {"RigCalibrateTip",
       {"rig", "calibrate", "tip", "--calibration", "also.yaml", "-o", "OUT", "--server", kNowhere,
        "--wait-s", "0"},
       ".yaml",
       {"also.yaml"},
       false},
  };
}

class OutputCommandTest : public RealBinaryTest, public ::testing::WithParamInterface<OutputCase> {
 protected:
  void SetUp() override {
    // Made once: six starts of the program before each test took longer than the tests.
    static const auto* const files = new std::map<std::string, std::string>(MakeInputs());
    for (const auto& [name, bytes] : *files) {
      ASSERT_FALSE(bytes.empty()) << name << " was not made";
      Write(name, bytes);
    }
  }

  // What the commands read, by name. In this test's folder, which is empty again afterwards.
  std::map<std::string, std::string> MakeInputs() {
    Write("map.csv",
          "object,x_mm,y_mm,z_mm,departure_mm,std_dev_mm,length_mm,rms_mm\nmine,50,0,0,0.1,0.02,22,0.3\n");
    for (const char* name : {"also.yaml", "report.json"})
      Write(name, "not read before the outputs are checked");
    const std::vector<std::vector<std::string>> commands = {
        {"model", "new", "-o", "model.yaml"},
        {"model", "add", "model.yaml", "tip_radius", "radius_mm=3", "-o", "tips.yaml"},
        {"mesh", "supershape", "lat20", "--triangles", "200", "-o", "mine.off"},
        {"plan", "lat20", "--plan", "faces", "--samples-per-face", "1", "--rounds", "1", "-o", "plan.csv"},
        {"touch", "--plan", "plan.csv", "-o", "set.csv"},
        {"session", "import", "set.csv", "-o", "session.db"}};
    for (const std::vector<std::string>& command : commands) EXPECT_EQ(Run(command).exit_code, 0);
    std::map<std::string, std::string> files;
    for (const char* name : {"map.csv", "also.yaml", "report.json", "model.yaml", "tips.yaml", "mine.off",
                             "plan.csv", "set.csv", "session.db"}) {
      files[name] = Read(name);
      fs::remove(Path(name));
    }
    return files;
  }

  std::string Out(const std::string& stem) const { return stem + GetParam().ending; }

  std::vector<std::string> Words(const std::string& out, bool force = false) const {
    std::vector<std::string> words = GetParam().words;
    std::replace(words.begin(), words.end(), std::string("OUT"), out);
    if (force) words.push_back("--force");
    return words;
  }

  void ExpectRefused(const std::string& out, bool force, const std::string& why) {
    const Outcome outcome = Run(Words(out, force));
    EXPECT_EQ(outcome.exit_code, 2) << out << ": " << outcome.err;
    EXPECT_THAT(outcome.err, AllOf(StartsWith("touchstone: error: -"), HasSubstr(why)));
    EXPECT_EQ(outcome.out, "");
  }

  mode_t ModeOf(const std::string& name) const {
    struct stat info {};
    ::lstat(Path(name).c_str(), &info);
    return info.st_mode;
  }
};

TEST_P(OutputCommandTest, AnExistingFileIsReplacedWithForceOnly) {
  const std::string out = Out("out");
  Write(out, "precious");
  ::chmod(Path(out).c_str(), 0640);
  ExpectRefused(out, false, out + " exists already; choose another name, or --force to replace it");
  EXPECT_EQ(Read(out), "precious");
  if (!GetParam().runs) return;
  ASSERT_EQ(Run(Words(out, true)).exit_code, 0);
  EXPECT_NE(Read(out), "precious");
  EXPECT_EQ(ModeOf(out) & 07777, 0640u);
}

TEST_P(OutputCommandTest, AnInputIsNeverWritten) {
  for (const std::string& input : GetParam().inputs) {
    const std::string before = Read(input);
    const std::string link = Out("link"), hard = Out("hard");
    fs::create_symlink(input, Path(link));
    fs::create_hard_link(Path(input), Path(hard));
    for (const std::string& name : {link, hard})
      for (const bool force : {false, true}) ExpectRefused(name, force, "which is read and never changed");
    if (fs::path(input).extension() == GetParam().ending)
      ExpectRefused(input, true, "which is read and never changed");
    EXPECT_EQ(Read(input), before);
    fs::remove(Path(link));
    fs::remove(Path(hard));
  }
}

TEST_P(OutputCommandTest, ALinkIsFollowedAndStays) {
  const std::string link = Out("link"), target = Out("target");
  Write(target, "precious");
  fs::create_symlink(target, Path(link));
  ExpectRefused(link, false, "exists already");
  EXPECT_EQ(Read(target), "precious");
  if (!GetParam().runs) return;
  fs::remove(Path(target));
  ASSERT_EQ(Run(Words(link)).exit_code, 0);
  EXPECT_TRUE(S_ISLNK(ModeOf(link)));
  EXPECT_TRUE(S_ISREG(ModeOf(target)));
}

TEST_P(OutputCommandTest, WhereNothingCanBeMadeItIsRefusedBeforeTheWork) {
  ExpectRefused("/proc/" + Out("out"), true, "cannot be made");
  ExpectRefused("nowhere/" + Out("out"), true, "there is no folder");
  fs::create_directory(Path(Out("folder")));
  ExpectRefused(Out("folder"), true, "is a folder");
}

TEST_P(OutputCommandTest, AFifoAndADeviceAreWrittenIntoAndStay) {
  if (!GetParam().runs) GTEST_SKIP() << "needs a rig, or minutes";
  const std::string fifo = Out("fifo"), node = Out("node"), file = Out("file");
  ASSERT_EQ(::mkfifo(Path(fifo).c_str(), 0600), 0);
  auto reader = std::async(std::launch::async, [&] {
    std::ifstream stream(Path(fifo), std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(stream), {});
  });
  const Outcome outcome = Run(Words(fifo));
  if (outcome.exit_code != 0) ::close(::open(Path(fifo).c_str(), O_RDWR));  // lets the reader go
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  const std::string data = reader.get();
  EXPECT_FALSE(data.empty());
  EXPECT_TRUE(S_ISFIFO(ModeOf(fifo)));
  // As /dev/null; only root may make one.
  if (::mknod(Path(node).c_str(), S_IFCHR | 0666, makedev(1, 3)) != 0) return;
  if (!std::ofstream(Path(node)).is_open()) return;  // a file system without device nodes
  for (const bool force : {false, true}) {
    EXPECT_EQ(Run(Words(node, force)).exit_code, 0);
    EXPECT_TRUE(S_ISCHR(ModeOf(node)));
  }
}

TEST_P(OutputCommandTest, AHyphenIsStandardOutputAndMessagesGoToStderr) {
  if (!GetParam().runs || !GetParam().stdout_works) GTEST_SKIP() << "needs a rig, or has no ending";
  const std::string out = Out("out");
  const Outcome to_file = Run(Words(out));
  ASSERT_EQ(to_file.exit_code, 0) << to_file.err;
  const Outcome to_stdout = Run(Words("-"));
  ASSERT_EQ(to_stdout.exit_code, 0) << to_stdout.err;
  EXPECT_FALSE(fs::exists(Path("-")));
  // A report says how long it took, and a model's name is its file's.
  if (GetParam().ending != ".json" && GetParam().ending != ".html" && GetParam().name != "ModelAdd" &&
      GetParam().name != "ModelRemove") {
    EXPECT_EQ(to_stdout.out, Read(out));
  }
  EXPECT_GT(to_stdout.out.size(), Read(out).size() / 2);
}

INSTANTIATE_TEST_SUITE_P(Commands, OutputCommandTest, ::testing::ValuesIn(Cases()),
                         [](const auto& info) { return info.param.name; });

class OutputsTest : public RealBinaryTest {};

TEST_F(OutputsTest, ATokenReplacesAFileWithForceOnly) {
  const std::vector<std::string> words = {"token", "new", "ana", "--role", "reader", "-o", "ana.token"};
  ASSERT_EQ(Run(words).exit_code, 0);
  const std::string first = Read("ana.token");
  const auto refused = Run(words);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("--force"));
  EXPECT_EQ(Read("ana.token"), first);
  std::vector<std::string> forced = words;
  forced.push_back("--force");
  EXPECT_EQ(Run(forced).exit_code, 0);
  EXPECT_NE(Read("ana.token"), first);
}

TEST_F(OutputsTest, EveryOptionThatNamesAnOutputIsInTheTable) {
  // Whoever adds an output adds a row: help says which commands have --force.
  std::set<std::string> commands, in_table;
  for (const OutputCase& output : Cases()) {
    const bool group = output.words[0] == "model" || output.words[0] == "mesh" ||
                       output.words[0] == "session" || output.words[0] == "rig";
    in_table.insert(group ? output.words[0] + " " + output.words[1] : output.words[0]);
  }
  const auto names_of = [](const std::string& help) {
    std::vector<std::string> names;
    std::istringstream lines(help.substr(std::min(help.find("\nCommands:"), help.size())));
    for (std::string line; std::getline(lines, line);)
      if (line.rfind("  ", 0) == 0 && line[2] != ' ')  // else the rest of a description
        names.push_back(line.substr(2, line.find(' ', 2) - 2));
    return names;
  };
  const auto has_force = [&](const std::string& help) {
    return help.find("\n  --force") != std::string::npos;
  };
  for (const std::string& name : names_of(Run({"--help"}).out)) {
    const std::string help = Run({name, "--help"}).out;
    if (has_force(help)) commands.insert(name);
    for (const std::string& inner : names_of(help))
      if (has_force(Run({name, inner, "--help"}).out)) commands.insert(name + " " + inner);
  }
  // A secret is another one each time, and goes into a new file of its owner's alone, into no link and no device.
  EXPECT_EQ(commands.erase("token new"), 1u);
  // A folder of files: demo_command_test.cpp.
  EXPECT_EQ(commands.erase("demo"), 1u);
  EXPECT_EQ(commands, in_table);
}

TEST_F(OutputsTest, TwoOutputsOfOneCommandAreTwoFiles) {
  Write("set.csv", "not read before the outputs are checked");
  EXPECT_THAT(Run({"diagnose", "set.csv", "--html", "a", "--json", "./a"}).err, HasSubstr("both are"));
  EXPECT_THAT(Run({"diagnose", "set.csv", "--html", "-", "--json", "-"}).err,
              HasSubstr("both are standard output"));
  EXPECT_THAT(Run({"model", "new", "--json", "-o", "-"}).err, HasSubstr("both are standard output"));
  EXPECT_EQ(Run({"diagnose", "set.csv", "--html", "a", "--json", "a", "--force"}).exit_code, 2);
}

TEST_F(OutputsTest, TheSetIsNotTakenForTheFileOfTheReport) {
  // --json took an optional file once, and the set behind it was overwritten.
  Write("set.csv", "precious");
  const Outcome outcome = Run({"diagnose", "--json", "set.csv"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_EQ(Read("set.csv"), "precious");
  EXPECT_EQ(Run({"diagnose", "set.csv", "--json"}).exit_code, 2);
}

TEST_F(OutputsTest, PhotographsOfAPlanReplaceNothing) {
  ASSERT_EQ(Run({"plan", "lat20", "--count", "3", "-o", "plan.csv"}).exit_code, 0);
  fs::create_directory(Path("views"));
  for (const std::string standing : {"views/touch-0002.png", "views/touch-0001.mask.png"}) {
    Write(standing, "precious");
    const std::vector<std::string> capture = {"capture", "lat20", "--plan",         "plan.csv",
                                              "--image", "16x16", "--renderer",     "cpu",
                                              "--mask",  "-o",    "views/touch.png"};
    const Outcome outcome = Run(capture);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr(standing + " exists already"));
    EXPECT_FALSE(fs::exists(Path("views/touch-0000.png"))) << "checked before the first photograph";
    fs::remove(Path(standing));
  }
}

TEST_F(OutputsTest, JournalsAndDatasetsAreResumedAndNoInputs) {
  ASSERT_EQ(Run({"plan", "lat20", "--count", "3", "-o", "plan.csv"}).exit_code, 0);
  ASSERT_EQ(Run({"touch", "--plan", "plan.csv", "-o", "set.csv"}).exit_code, 0);
  ASSERT_EQ(Run({"session", "import", "set.csv", "-o", "session.db"}).exit_code, 0);
  EXPECT_EQ(Run({"session", "import", "set.csv", "-o", "session.db", "--session", "again"}).exit_code, 0);
  for (int i = 0; i < 2; ++i)
    EXPECT_EQ(Run({"stream", "--samples", "10", "--to", "folder", "--out", "data"}).exit_code, 0);
  EXPECT_EQ(Run({"stream", "--samples", "10", "--out", "-"}).exit_code, 2);
  EXPECT_EQ(Run({"stream", "--samples", "10", "--out", "set.csv"}).exit_code, 2);
  EXPECT_EQ(Run({"stream", "--like", "data/dataset.json", "--out", "data", "--restart"}).exit_code, 2);
  EXPECT_TRUE(fs::exists(Path("data/dataset.json")));
}

}  // namespace
}  // namespace touchstone::cli
