// What is wrong with a command line is said with the option, the value and what would be right.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "client/cli/tests/real_binary_test.h"

namespace touchstone::cli {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class UsageErrorTest : public RealBinaryTest {};

TEST_F(UsageErrorTest, UnknownWordsAreAnsweredWithTheNearestKnown) {
  const std::pair<std::vector<std::string>, std::string> cases[] = {
      {{"strem"}, "unknown command 'strem', did you mean 'stream'?"},
      {{"model", "shwo"}, "unknown command 'shwo', did you mean 'show'?"},
      {{"stream", "--sampels", "5", "--out", "x"}, "unknown option '--sampels', did you mean '--samples'?"},
      {{"effects", "tip_radios"}, "did you mean 'tip_radius'?"},
      {{"touch", "lat2", "--approach", "0,0,-1"}, "lat2"},
      {{"model", "add", "nominal", "tip_radius", "radius=3"}, "did you mean 'radius_mm'?"},
      {{"stream", "--to", "webdatset", "--out", "x"}, "did you mean 'webdataset'?"},
      {{"stream", "--columns", "descripter", "--out", "x"}, "did you mean 'descriptor'?"},
      {{"mesh", "supershape", "lat21", "-o", "x.off"}, "lat21"},
  };
  for (const auto& [arguments, words] : cases) {
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    EXPECT_THAT(outcome.err, AllOf(StartsWith("touchstone: error: "), HasSubstr(words)));
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << "one line: " << outcome.err;
    EXPECT_EQ(outcome.out, "");
  }
}

TEST_F(UsageErrorTest, BadInputIsExitCode2AndNamesFieldAndValue) {
  Write("bad.csv", "touch,object\n0,lat20\n");
  Write("bad.yaml", "touchstone: model/1\nname: x\nefects: []\n");
  const std::pair<std::vector<std::string>, std::string> cases[] = {
      {{"touch", "lat20", "--approach", "0,0"}, "--approach: '0,0' has 2 parts"},
      {{"touch", "lat20", "--approach", "0,0,0"}, "approach"},
      {{"touch", "lat20", "--approach", "0,0,nan"}, "not a finite number"},
      {{"touch", "lat20", "--approach", "0,0,-1", "--lateral", "0,0,1"}, "lateral"},
      {{"touch", "lat20", "--approach", "0,0,-1", "--speed-mm-s", "-1"}, "speed"},
      {{"touch", "--plan", "bad.csv"}, "bad.csv:1: column 'speed_mm_s' is missing"},
      {{"touch", "--plan", "none.csv"}, "none.csv"},
      {{"touch", "lat20", "--approach", "0,0,-1", "--model", "bad.yaml"}, "efects"},
      {{"stream", "--out", "d", "--rounds", "3"}, "--rounds belongs to --plan faces"},
      {{"stream", "--out", "d", "--samples", "0"}, "--samples: 0 is out of range; 1 or more was expected"},
      {{"model", "add", "nominal", "tip_radius", "-o", "tips.yaml"},
       "'tip_radius' without a value changes nothing; its size was expected, for instance radius_mm=1.5 "},
      {{"stream", "--out", "d", "--image", "0x5"}, "--image: '0x5' is no size"},
      {{"stream", "--out", "d", "--image", "20000x20000"}, "20000"},
      {{"stream", "--out", "d", "--shards", "4/4"}, "--shards: '4/4'"},
      {{"stream", "--out", "d", "--to", "hdf5", "--encoding", "png"},
       "--encoding: png does not go into HDF5"},
      {{"stream", "--out", "/proc/nowhere"}, "--out: /proc/nowhere"},
      {{"capture", "lat20", "--approach", "0,0,-1", "-o", "x.gif"}, "x.gif"},
      {{"objects", "--mesh", "cup"}, "cup"},
      {{"objects", "--server", "nowhere"}, "'nowhere' is not HOST:PORT"},
      {{"objects", "--server", "127.0.0.1:1", "--mesh", "a=b.off"}, "--mesh: works only without --server"},
      {{"objects", "extra"}, "'extra' is one argument too many"},
      {{"touch", "lat20", "--approach", "0,0,-1", "--session", "a b"},
       "--session: 'a b' is no session's name"},
      {{"objects", "--mesh-dir", "nope"},
       "--mesh-dir: 'nope': No such file or directory; a folder of mesh files was expected"},
      {{"plan", "lat20", "--mesh-dir", "bad.csv"}, "--mesh-dir: 'bad.csv': Not a directory"},
      {{"compare", "bad.csv", "--mesh-dir", "nope"}, "--mesh-dir: 'nope': No such file"},
      {{"uncertainty", "nope.json", "bad.csv"},
       "nope.json: No such file or directory; a report of `touchstone diagnose SET --json FILE` was "
       "expected"},
      {{"rig", "status"}, "--server is missing"},
      {{"rig", "stop"}, "--server is missing"},
      {{"rig", "mount", "lat20", "+w", "--server", "127.0.0.1:1"}, "FACE: '+w'"},
      {{"rig", "run", "none.csv", "-o", "set.txt"}, "-o: 'set.txt' does not say the format"},
      {{"session", "list", "set.csv"}, "'set.csv' is no journal"},
      {{"session", "list", "none.db"}, "none.db"},
      {{"session", "export", "monday", "tuesday"}, "'tuesday' is one argument too many"},
      {{"session", "import", "bad.csv", "-o", "set.csv"}, "'set.csv' is no journal"},
  };
  for (const auto& [arguments, words] : cases) {
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << words << ": " << outcome.err;
    EXPECT_THAT(outcome.err, AllOf(StartsWith("touchstone: error: "), HasSubstr(words)));
  }
}

TEST_F(UsageErrorTest, AnUnreachableSourceIsExitCode3) {
  const Outcome outcome = Run({"objects", "--server", "127.0.0.1:1", "--wait-s", "0"});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("127.0.0.1:1"));
}

TEST_F(UsageErrorTest, ACountIsAWholeNumberFromZeroOn) {
  for (const std::string count : {"-5", "1e-6", "2.5", "ten"}) {
    const Outcome outcome = Run({"stream", "--samples=" + count, "--out", "d"});
    EXPECT_EQ(outcome.exit_code, 2) << count;
    EXPECT_THAT(outcome.err, HasSubstr("--samples")) << count;
  }
  EXPECT_THAT(Run({"stream", "--samples", "-5", "--out", "d"}).err,
              HasSubstr("--samples: '-5' is no whole number from 0 on"));
  EXPECT_THAT(Run({"touch", "lat20", "--approach", "0,0,-1", "--seed", "99999999999999999999"}).err,
              HasSubstr("--seed: '99999999999999999999' is too large"));
  EXPECT_EQ(Run({"touch", "lat20", "--approach", "0,0,-1", "--repeats", "1e1"}).out,
            Run({"touch", "lat20", "--approach", "0,0,-1", "--repeats", "10"}).out);
  // Not the octal number that C would read.
  EXPECT_EQ(Run({"touch", "lat20", "--approach", "0,0,-1", "--repeats", "010"}).out,
            Run({"touch", "lat20", "--approach", "0,0,-1", "--repeats", "10"}).out);
}

TEST_F(UsageErrorTest, ValuesAreNamedAsTheyWereTyped) {
  Write("set.csv", "touch,object\n");
  Write("open.yaml", "touchstone: model/1\nname: x\neffects:\n  - tip_radius: {radius_mm: 3\n");
  Write("tab.yaml", "touchstone: model/1\nname: x\neffects:\n\t- tip_radius: {radius_mm: 3}\n");
  const std::pair<std::vector<std::string>, std::string> cases[] = {
      {{"touch", "lat20", "--approach", "0,0,-1", "--speed-mm-s", "-5"}, "--speed-mm-s: -5 is out of range"},
      {{"touch", "lat20", "--approach", "0,0,-1", "--speed-mm-s", "20mm"},
       "--speed-mm-s: '20mm' is not a number"},
      {{"touch", "lat20", "--approach", "0,0,-1", "--standoff-mm", "1e9"},
       "--standoff-mm: 1e+09 is out of range"},
      {{"touch", "lat20", "--approach", "0,0,-1", "--model", "set.csv"},
       "model: 'set.csv' is a file, but no model"},
      {{"plan", "lat20", "--plan", "faces", "--rounds", "999999999"}, "rounds = 999999999"},
      {{"model", "show", "open.yaml"}, "is a '}' or a comma missing?"},
      {{"model", "show", "tab.yaml"}, "by spaces, not by tabs"},
  };
  for (const auto& [arguments, words] : cases) {
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << words << ": " << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(words));
  }
}

TEST_F(UsageErrorTest, ARigIsMissedByTheNameOfItsProgram) {
  const Outcome outcome = Run({"rig", "status", "--server", "127.0.0.1:1", "--wait-s", "0"});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("touchstone-gateway"));
}

TEST_F(UsageErrorTest, CountsAndSeedsAreWholeNumbersOfAnyFormButNoOther) {
  const std::pair<std::vector<std::string>, std::string> cases[] = {
      {{"stream", "--samples", "-1", "--out", "x"}, "'-1' is no whole number"},
      {{"stream", "--samples", "1.5", "--out", "x"}, "'1.5' is no whole number"},
      {{"stream", "--seed", "18446744073709551616", "--out", "x"}, "is too large"},
      {{"touch", "lat20", "--approach", "0,0,-1", "--seed=-7"}, "'-7' is no whole number"},
      {{"plan", "lat20", "--count", "5e9", "-o", "x.csv"}, "--count: '5000000000' is too large"},
      {{"touch", "lat20", "--approach", "0,0,-1", "--threads", "5e9"},
       "--threads: '5000000000' is too large"},
      {{"capture", "lat20", "--eye-mm", "300,0,80", "--jpeg-quality", "1e30", "-o", "x.jpg"}, "is too large"},
  };
  for (const auto& [arguments, words] : cases) {
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << words << ": " << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(words));
  }
  EXPECT_EQ(Run({"touch", "lat20", "--approach", "0,0,-1", "--seed", "1e6", "-q"}).out,
            Run({"touch", "lat20", "--approach", "0,0,-1", "--seed", "1_000_000", "-q"}).out);
}

}  // namespace
}  // namespace touchstone::cli
