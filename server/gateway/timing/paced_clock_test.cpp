#include "server/gateway/timing/paced_clock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <thread>

#include "server/base/test_folder.h"
#include "server/gateway/timing/host_time.h"

namespace touchstone::gateway::timing {
namespace {

using testing::HasSubstr;

TEST(PacedClock, GoesLikeTheSteadyClockUntilTheMomentThatItIsGiven) {
  const PacedClock::Course course{100, 2, 5, 70};
  EXPECT_EQ(course.SinceS(100), 2);
  EXPECT_EQ(course.SinceS(101.5), 3.5);
  EXPECT_EQ(course.SinceS(103), 5);
  EXPECT_EQ(course.SinceS(1000), 5);
  EXPECT_EQ(course.StandsFromS(), 103);
  EXPECT_EQ(course.SinceS(99), 2) << "it does not go back";
}

TEST(PacedClock, OfAFileIsReadAsItWasSet) {
  const TestFolder folder;
  const auto kept = MakePacedClock(folder.Path("clock"));
  kept->Set({1, 2, 3, 4});
  const auto read = OpenPacedClock(folder.Path("clock"));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ((*read)->Get().since_s, 2);
  kept->Set({5, 6, 7, 8});
  EXPECT_EQ((*read)->Get().steady_s, 5);
  EXPECT_EQ((*read)->Get().began_s, 8);
}

TEST(PacedClock, IsNeverReadHalfSet) {
  PacedClock clock;
  std::thread keeper([&] {
    for (int k = 1; k <= 200'000; ++k) clock.Set({1.0 * k, 2.0 * k, 3.0 * k, 4.0 * k});
  });
  for (double newest = 0; newest < 200'000;) {
    const PacedClock::Course course = clock.Get();
    ASSERT_EQ(course.since_s, 2 * course.steady_s);
    ASSERT_EQ(course.began_s, 4 * course.steady_s);
    newest = course.steady_s;
  }
  keeper.join();
}

TEST(HostTime, FollowsTheClockOfAnEmulatedRigWhichStandsAndGoesOn) {
  const TestFolder folder;
  const auto clock = MakePacedClock(folder.Path("clock"));
  const double steady_s = HostNowS();
  clock->Set({steady_s, 0, 0, 50});
  ASSERT_TRUE(FollowClock(folder.Path("clock")).ok());
  EXPECT_EQ(HostNowS(), 50);
  EXPECT_GE(HostLagS(), steady_s - 50);
  clock->Set({steady_s, 1, 1, 50});
  EXPECT_EQ(HostNowS(), 51);
  // An emulator that has been gone for a minute holds up nothing; when it goes on, no time comes twice.
  clock->Set({steady_s - 60, 1, 1, 50});
  const double alone_s = HostNowS();
  EXPECT_GE(alone_s, 51 + 60 - kEmulatorGoneS);
  clock->Set({steady_s, 2, 2, 50});
  EXPECT_GE(HostNowS(), alone_s);
  ASSERT_TRUE(FollowClock("").ok());
  EXPECT_GE(HostNowS(), steady_s);
  EXPECT_LT(HostLagS(), 1e-3);
}

TEST(HostTime, RefusesAFileThatIsNoClock) {
  const TestFolder folder;
  EXPECT_THAT(std::string(FollowClock(folder.Path("none")).message()), HasSubstr("cannot open"));
  std::ofstream(folder.Path("text")) << "tick";
  EXPECT_THAT(std::string(FollowClock(folder.Path("text")).message()), HasSubstr("is no clock"));
}

}  // namespace
}  // namespace touchstone::gateway::timing
