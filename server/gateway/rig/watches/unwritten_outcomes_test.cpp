#include "server/gateway/rig/watches/unwritten_outcomes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/files/full_disk.h"
#include "server/base/test_folder.h"

namespace touchstone::gateway {
namespace {

using session::TouchStage;
using testing::HasSubstr;

class UnwrittenOutcomesTest : public testing::Test {
 protected:
  UnwrittenOutcomesTest() {
    journal_ = *session::Journal::Open(folder_.Path("rig.db"), session::Journal::Mode::kCreateOrReadWrite);
    session::JournalSession session;
    session.name = "s";
    session.fingers = 1;
    EXPECT_TRUE(journal_->EnsureSession(session).ok());
    result_.fingers.resize(1);
    result_.fingers[0].contact_time_s = 0.75;
  }

  absl::Status Begin(const std::string& id) {
    return journal_->BeginExecuting("s", id, "cup", "+z", id, 1, 1).status();
  }
  TouchStage StageOf(const std::string& id) { return (*journal_->Find("s", id))->stage; }

  const TestFolder folder_;
  std::unique_ptr<session::Journal> journal_;
  session::JournalResult result_;
};

TEST_F(UnwrittenOutcomesTest, AResultThatFindsNoSpaceIsKeptUntilThereIsSome) {
  UnwrittenOutcomes outcomes(journal_.get());
  ASSERT_TRUE(Begin("a").ok());
  const session::JournalSeries series{"raw", "abc"};
  {
    const FullDisk full;
    const absl::Status kept = outcomes.Done("s", "a", result_, &series);
    EXPECT_TRUE(absl::IsResourceExhausted(kept)) << kept;
    EXPECT_THAT(std::string(kept.message()),
                HasSubstr("touch 'a' was made, but its result could not be written"));
    EXPECT_THAT(std::string(kept.message()), HasSubstr("ask again under the same id; it is not made again"));
    outcomes.Flush();
    EXPECT_TRUE(absl::IsResourceExhausted(outcomes.Kept("s", "a")));
    EXPECT_TRUE(outcomes.Kept("s", "b").ok());
    EXPECT_EQ(StageOf("a"), TouchStage::kExecuting);
    EXPECT_TRUE(absl::IsResourceExhausted(Begin("b")));
  }
  outcomes.Flush();
  EXPECT_TRUE(outcomes.Kept("s", "a").ok());
  EXPECT_EQ((*journal_->Find("s", "a"))->result.fingers.at(0).contact_time_s, 0.75);
  EXPECT_EQ((*journal_->Series("s", "a"))->columns, "abc");
  EXPECT_TRUE(Begin("b").ok()) << "what was refused for want of space left no trace";
}

TEST_F(UnwrittenOutcomesTest, AFailureThatFindsNoSpaceFreesTheIdOnceThereIsSome) {
  UnwrittenOutcomes outcomes(journal_.get());
  ASSERT_TRUE(Begin("a").ok());
  {
    const FullDisk full;
    EXPECT_TRUE(absl::IsResourceExhausted(outcomes.Failed("s", "a", "the arm was stopped")));
  }
  EXPECT_TRUE(absl::IsAborted(Begin("a")));
  outcomes.Flush();
  EXPECT_EQ(StageOf("a"), TouchStage::kFailed);
  EXPECT_EQ((*journal_->Find("s", "a"))->error, "the arm was stopped");
  EXPECT_TRUE(Begin("a").ok());
  EXPECT_EQ((*journal_->Find("s", "a"))->attempt, 2);
}

TEST_F(UnwrittenOutcomesTest, AStopThatFindsNoSpaceIsWrittenLaterUnlessItWasReleased) {
  UnwrittenOutcomes outcomes(journal_.get());
  for (const bool released : {false, true}) {
    {
      const FullDisk full;
      EXPECT_TRUE(
          absl::IsResourceExhausted(outcomes.SetFacts({{"stop", released ? "by ben" : "by ana"}}, true)));
      EXPECT_TRUE(absl::IsResourceExhausted(outcomes.SetFacts({{"stop", ""}}, false)));
    }
    if (released) {
      ASSERT_TRUE(outcomes.SetFacts({{"stop", ""}}, false).ok());
    }
    outcomes.Flush();
    EXPECT_EQ(*journal_->Metadata("stop"), released ? "" : "by ana");
  }
}

TEST_F(UnwrittenOutcomesTest, TheEndOfTheProcessTriesOnceMore) {
  ASSERT_TRUE(Begin("a").ok());
  {
    UnwrittenOutcomes outcomes(journal_.get());
    const FullDisk full;
    EXPECT_FALSE(outcomes.Done("s", "a", result_).ok());
  }
  // The space came back first: what was made last goes first.
  EXPECT_EQ(StageOf("a"), TouchStage::kDone);
}

TEST_F(UnwrittenOutcomesTest, AStepThatIsWrongIsNotKept) {
  UnwrittenOutcomes outcomes(journal_.get());
  EXPECT_TRUE(absl::IsNotFound(outcomes.Done("s", "none", result_)));
  ASSERT_TRUE(Begin("a").ok());
  ASSERT_TRUE(outcomes.Done("s", "a", result_).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(outcomes.Failed("s", "a", "why")));
  EXPECT_TRUE(outcomes.Kept("s", "a").ok());
}

}  // namespace
}  // namespace touchstone::gateway
