#include "server/gateway/rig/watches/session_clock.h"

#include <gtest/gtest.h>

#include "server/base/test_folder.h"

namespace touchstone::gateway {
namespace {

constexpr double kHourS = 3600;

class SessionClockTest : public testing::Test {
 protected:
  SessionClockTest() { Open(); }

  void Open() {
    clock_ = nullptr;
    journal_ = nullptr;
    journal_ = *session::Journal::Open(folder_.Path("rig.db"), session::Journal::Mode::kCreateOrReadWrite);
    session::JournalSession session;
    session.name = "s";
    session.fingers = 1;
    EXPECT_TRUE(journal_->EnsureSession(session).ok());
    clock_ = std::make_unique<SessionClock>(journal_.get(), time_scale_, [this] { return now_; });
  }

  // A host that runs on for so long.
  void Pass(double seconds) {
    now_.boot_s += seconds;
    now_.unix_s += seconds;
  }
  // The host is off for so long, and its process begins `up_s` after it was powered on.
  void Reboot(double off_s, double up_s) {
    now_.boot_id += "'";
    now_.boot_s = up_s;
    now_.unix_s += off_s + up_s;
    Open();
  }

  double NowS() {
    const auto now_s = clock_->NowS("s");
    EXPECT_TRUE(now_s.ok()) << now_s.status();
    return now_s.value_or(-1);
  }

  // A touch that begins now.
  double Touch() {
    const double began_s = NowS();
    const std::string id = std::to_string(touches_++);
    session::JournalResult result;
    result.fingers.resize(1);
    result.session_time_s = began_s;
    result.start_unix_s = now_.unix_s;
    EXPECT_TRUE(journal_->BeginExecuting("s", id, "cup", "+z", id, 1, 1).ok());
    EXPECT_TRUE(journal_->Done("s", id, result).ok());
    return began_s;
  }

  // A photograph that is taken now.
  double Photograph() {
    const double taken_s = NowS();
    session::JournalImage image;
    image.id = "picture " + std::to_string(touches_++);
    image.unix_s = now_.unix_s;
    image.view.emplace().session_time_s = taken_s;
    EXPECT_TRUE(journal_->AddImage("s", image).ok());
    return taken_s;
  }

  const TestFolder folder_;
  double time_scale_ = 1;
  HostClocks now_{"boot", 5000, 1.7e9};
  int touches_ = 0;
  std::unique_ptr<session::Journal> journal_;
  std::unique_ptr<SessionClock> clock_;
};

TEST_F(SessionClockTest, CountsFromTheFirstTouchWhateverTheWallClockDoes) {
  EXPECT_EQ(Touch(), 0);
  Pass(10);
  EXPECT_NEAR(Touch(), 10, 1e-6);
  now_.unix_s += kHourS;  // corrected ahead, or summer time
  Pass(10);
  EXPECT_NEAR(Touch(), 20, 1e-6);
  now_.unix_s -= 2 * kHourS;
  Pass(10);
  EXPECT_NEAR(Touch(), 30, 1e-6);
}

TEST_F(SessionClockTest, GoesOnWithoutAStepInAnotherProcessOfTheSameBoot) {
  Touch();
  Pass(100);
  Touch();
  now_.unix_s -= kHourS;
  Pass(50);
  Open();
  EXPECT_NEAR(Touch(), 150, 1e-6);
  now_.unix_s += 3 * kHourS;
  Open();
  Pass(1);
  EXPECT_NEAR(Touch(), 151, 1e-6);
}

TEST_F(SessionClockTest, GoesOnAfterARebootByWhatTheWallClockHasGone) {
  Touch();
  Pass(100);
  Touch();
  Pass(20);
  Reboot(30, 40);
  EXPECT_NEAR(Touch(), 190, 1e-5);
  // From here on, the new boot's clock counts.
  now_.unix_s += kHourS;
  Pass(5);
  EXPECT_NEAR(Touch(), 195, 1e-5);
}

TEST_F(SessionClockTest, CountsPhotographsAndTouchesOnOneClock) {
  EXPECT_EQ(Photograph(), 0);
  Pass(10);
  EXPECT_NEAR(Touch(), 10, 1e-6);
  // The wall clock was wrong when the photographs were taken, and corrected before the last touch.
  now_.unix_s += kHourS;
  Pass(10);
  EXPECT_NEAR(Touch(), 20, 1e-6);
  Reboot(30, 40);
  EXPECT_NEAR(Photograph(), 90, 1e-5);
  Pass(5);
  Reboot(10, 20);
  EXPECT_NEAR(Touch(), 125, 1e-5);
}

TEST_F(SessionClockTest, NeverGoesBackWhenTheWallClockWasSetBackAcrossAReboot) {
  Touch();
  Pass(100);
  Touch();
  now_.unix_s -= kHourS;
  Reboot(30, 40);
  // Since the boot 40 s have passed; the wall clock cannot be right.
  EXPECT_NEAR(Touch(), 140, 1e-5);
}

TEST_F(SessionClockTest, AHostWithoutAClockOfItsOwnMakesNoStepOfYears) {
  Touch();
  Pass(100);
  Touch();
  now_.unix_s = 1.7e9 + 5 * 365 * 86400.0;
  Reboot(0, 40);
  EXPECT_NEAR(Touch(), 140, 1e-5);
  now_.unix_s = 0;
  Reboot(0, 30);
  EXPECT_NEAR(Touch(), 170, 1e-5);
}

TEST_F(SessionClockTest, ResumesTheTouchesOfAJournalThatKeptNoClock) {
  session::JournalResult result;
  result.fingers.resize(1);
  result.session_time_s = 500;
  result.start_unix_s = 1.7e9;
  ASSERT_TRUE(journal_->BeginExecuting("s", "old", "cup", "+z", "old", 1, 1).ok());
  ASSERT_TRUE(journal_->Done("s", "old", result).ok());
  now_.unix_s = 1.7e9 + 60;
  EXPECT_NEAR(Touch(), 560, 1e-5);
}

TEST_F(SessionClockTest, CountsSecondsOfTheRig) {
  time_scale_ = 8;
  Open();
  Touch();
  Pass(10);
  EXPECT_NEAR(Touch(), 80, 1e-5);
  Pass(10);
  Reboot(5, 5);
  EXPECT_NEAR(Touch(), 80 + 8 * 20, 1e-4);
}

TEST_F(SessionClockTest, ReadsTheClocksOfThisHost) {
  const HostClocks one = ReadHostClocks(), two = ReadHostClocks();
  EXPECT_EQ(one.boot_id.size(), 36u);
  EXPECT_EQ(one.boot_id, two.boot_id);
  EXPECT_GE(two.boot_s, one.boot_s);
  EXPECT_GT(one.boot_s, 0);
  EXPECT_GT(one.unix_s, 1.7e9);
}

}  // namespace
}  // namespace touchstone::gateway
