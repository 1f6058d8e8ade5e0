#include "client/cli/common/progress_bar.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <string>

namespace touchstone::cli {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

// A pipe whose lines are read as they come.
class Pipe {
 public:
  Pipe() {
    EXPECT_EQ(::pipe(ends_), 0);
    writer_ = ::fdopen(ends_[1], "w");
  }
  ~Pipe() {
    if (writer_ != nullptr) std::fclose(writer_);
    ::close(ends_[0]);
  }
  std::FILE* writer() const { return writer_; }
  // Waits for it.
  std::string Line() {
    std::string line;
    for (char c; ::read(ends_[0], &c, 1) == 1 && c != '\n';) line += c;
    return line;
  }
  // What was written and not read yet, once nobody writes any more.
  std::string Rest() {
    std::fclose(writer_);
    writer_ = nullptr;
    std::string text;
    for (char c; ::read(ends_[0], &c, 1) == 1;) text += c;
    return text;
  }

 private:
  int ends_[2] = {-1, -1};
  std::FILE* writer_ = nullptr;
};

TEST(Progress, LeavesTheTimeOpenUntilItCanBeTold) {
  EXPECT_LT(SecondsLeft(0.5, 0, 0.2), 0) << "too early";
  EXPECT_LT(SecondsLeft(0.001, 0, 20), 0) << "too little was done";
  EXPECT_LT(SecondsLeft(-1, 0, 20), 0);
  EXPECT_DOUBLE_EQ(SecondsLeft(0.25, 0, 20), 60);
  EXPECT_DOUBLE_EQ(SecondsLeft(0.75, 0.5, 20), 20) << "half was done before";
}

TEST(Progress, InPlaceIsOneLineOfTheTerminal) {
  const Progress progress{"fitting tip_radius", 0.5, "20 of 40 sets", 63};
  EXPECT_EQ(ProgressInPlace(progress, 10, 120),
            "[###############...............]  50.0 %  20 of 40 sets  1 min 3 s left  fitting tip_radius");
  for (const size_t width : {20, 60, 80, 120}) EXPECT_LT(ProgressInPlace(progress, 10, width).size(), width);
  EXPECT_EQ(ProgressInPlace({"waiting", -1, "", -1}, 12.7, 80), "12 s so far  waiting");
}

TEST(Progress, AsALineSaysHowMuchHowLongAndWhat) {
  EXPECT_EQ(ProgressLine({"fitting tip_radius", 0.12, "5 of 40 sets", 140}, 20),
            "12 % after 20 s, 5 of 40 sets, 2 min 20 s left: fitting tip_radius");
  EXPECT_EQ(ProgressLine({"waiting", -1, "", -1}, 20), "after 20 s: waiting");
}

TEST(ProgressBar, WritesLinesWithoutATerminalAlsoWhereTheWorkIsSilent) {
  Pipe pipe;
  ProgressBar bar(true, {pipe.writer(), false, milliseconds(1), milliseconds(1)});
  bar.ShowStage("fitting", 0.5);
  // The stage is not named again, and the lines go on.
  for (int k = 0; k < 3; ++k) {
    const std::string line = pipe.Line();
    EXPECT_THAT(line, StartsWith("50 % after "));
    EXPECT_THAT(line, EndsWith(": fitting"));
    EXPECT_THAT(line, Not(HasSubstr("\x1b")));
  }
}

TEST(ProgressBar, ShowsNothingOfWhatIsDoneBeforeItsFirstMoment) {
  Pipe pipe;
  {
    ProgressBar bar(true, {pipe.writer(), false, hours(1), hours(1)});
    bar.ShowStage("fitting", 0.1);
    bar.Show(9, 10, 9);
  }
  EXPECT_EQ(pipe.Rest(), "");
}

TEST(ProgressBar, ShowsNothingWhereItIsQuiet) {
  Pipe pipe;
  {
    ProgressBar bar(false, {pipe.writer(), true, milliseconds(0), milliseconds(0)});
    bar.ShowStage("fitting", 0.1);
  }
  EXPECT_EQ(pipe.Rest(), "");
}

TEST(ProgressBar, WipesWhatItDrewBeforeOtherTextIsWritten) {
  Pipe pipe;
  {
    ProgressBar bar(true, {pipe.writer(), true, milliseconds(0), hours(1)});
    bar.Show(10, 40, 10, "pictures");
    bar.Clear();
    std::fprintf(pipe.writer(), "note\n");
    std::fflush(pipe.writer());
  }
  const std::string line = pipe.Line();
  EXPECT_THAT(line, HasSubstr("]  25.0 %  10 of 40 pictures"));
  EXPECT_THAT(line, EndsWith("\r\x1b[Knote"));
}

TEST(ProgressBar, PutsAPartIntoTheWhole) {
  Pipe pipe;
  ProgressBar bar(true, {pipe.writer(), false, milliseconds(1), milliseconds(1)});
  bar.SetPart("set 3 of 4", 0.5, 0.75);
  bar.ShowStage("fitting", 0.5);
  const std::string line = pipe.Line();
  EXPECT_THAT(line, StartsWith("62 % after "));
  EXPECT_THAT(line, EndsWith(": set 3 of 4, fitting"));
}

}  // namespace
}  // namespace touchstone::cli
