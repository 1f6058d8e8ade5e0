#include "server/session/journal/journal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <thread>

#include "server/base/numbers/nan.h"
#include "server/base/test_folder.h"
#include "server/base/text/text.h"
#include "server/session/journal/command_bytes.h"

namespace touchstone::session {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class JournalTest : public ::testing::Test {
 protected:
  JournalTest() { path_ = folder_ + "/session.db"; }

  std::unique_ptr<Journal> Open(Journal::Mode mode = Journal::Mode::kCreateOrReadWrite,
                                std::string path = "") {
    auto journal = Journal::Open(path.empty() ? path_ : path, mode);
    EXPECT_TRUE(journal.ok()) << journal.status();
    return journal.ok() ? *std::move(journal) : nullptr;
  }

  std::unique_ptr<Journal> OpenWithSession() {
    std::unique_ptr<Journal> journal = Open();
    EXPECT_TRUE(journal->EnsureSession(SessionNamed("s")).ok());
    return journal;
  }

  static JournalSession SessionNamed(const std::string& name) {
    JournalSession session;
    session.name = name;
    session.created_unix_s = 1.7e9;
    session.provenance = "emulated rig";
    session.calibration = "touchstone: calibration/1\n";
    return session;
  }

  static JournalResult ResultOf(double first_s) {
    JournalResult result;
    for (int i = 0; i < 3; ++i) {
      JournalFinger finger;
      finger.contact_time_s = first_s + 0.001 * i;
      finger.base_from_tip = {0.3, 0.1, 0.2, 3.1, 0, 0.01 * i};
      finger.ticks = (uint64_t{1} << 63) + i;
      result.fingers.push_back(finger);
    }
    result.speed_m_s = 0.0199;
    result.session_time_s = 12.5;
    result.start_unix_s = 1.7e9 + 12.5;
    result.time_uncertainty_s = 1e-6;
    result.synchronisation_uncertainty_s = 2e-6;
    result.effector_drift = 1e-4;
    return result;
  }

  static std::string Message(const absl::Status& status) { return std::string(status.message()); }

  const TestFolder test_folder_;
  const std::string& folder_ = test_folder_.path();
  std::string path_;
};

TEST_F(JournalTest, ATouchGoesFromIntentOverExecutingToItsResult) {
  auto journal = OpenWithSession();
  const auto begun = journal->Begin("s", "a", "cup", "+z", "command");
  ASSERT_TRUE(begun.ok()) << begun.status();
  EXPECT_EQ(begun->stage, TouchStage::kIntent);
  EXPECT_EQ(begun->number, 0u);
  EXPECT_EQ(begun->attempt, 1);
  ASSERT_TRUE(journal->Executing("s", "a", 7, 4'000'000'000u).ok());
  auto unfinished = journal->Unfinished();
  ASSERT_TRUE(unfinished.ok());
  ASSERT_EQ(unfinished->size(), 1u);
  EXPECT_EQ((*unfinished)[0].first, "s");
  EXPECT_EQ((*unfinished)[0].second.program_id, 7u);
  EXPECT_EQ((*unfinished)[0].second.boot_id, 4'000'000'000u);
  JournalResult result = ResultOf(1.25);
  result.fingers[1].contact_time_s = kNaN;
  result.fingers[1].base_from_tip.fill(kNaN);
  result.recovered = true;
  ASSERT_TRUE(journal->Done("s", "a", result).ok());
  const auto found = journal->Find("s", "a");
  ASSERT_TRUE(found.ok() && found->has_value());
  EXPECT_EQ((*found)->stage, TouchStage::kDone);
  EXPECT_EQ((*found)->command, "command");
  EXPECT_EQ((*found)->up_face, "+z");
  const JournalResult& kept = (*found)->result;
  ASSERT_EQ(kept.fingers.size(), 3u);
  EXPECT_EQ(kept.fingers[0].contact_time_s, 1.25);
  EXPECT_TRUE(std::isnan(kept.fingers[1].contact_time_s));
  EXPECT_TRUE(std::isnan(kept.fingers[1].base_from_tip[5]));
  EXPECT_EQ(kept.fingers[2].base_from_tip, result.fingers[2].base_from_tip);
  EXPECT_EQ(kept.fingers[2].ticks, (uint64_t{1} << 63) + 2);
  EXPECT_EQ(kept.speed_m_s, result.speed_m_s);
  EXPECT_EQ(kept.session_time_s, result.session_time_s);
  EXPECT_EQ(kept.start_unix_s, result.start_unix_s);
  EXPECT_EQ(kept.time_uncertainty_s, result.time_uncertainty_s);
  EXPECT_EQ(kept.synchronisation_uncertainty_s, result.synchronisation_uncertainty_s);
  EXPECT_EQ(kept.effector_drift, result.effector_drift);
  EXPECT_TRUE(kept.recovered);
  EXPECT_TRUE(journal->Unfinished()->empty());
}

TEST_F(JournalTest, ADoneTouchIsGivenBackAndNotMadeAgain) {
  auto journal = OpenWithSession();
  ASSERT_TRUE(journal->Begin("s", "a", "cup", "+z", "command").ok());
  ASSERT_TRUE(journal->Executing("s", "a", 1, 1).ok());
  ASSERT_TRUE(journal->Done("s", "a", ResultOf(1)).ok());
  const auto again = journal->Begin("s", "a", "cup", "+z", "command");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->stage, TouchStage::kDone);
  EXPECT_EQ(again->result.fingers[0].contact_time_s, 1);
  EXPECT_EQ(journal->Session("s")->touches, 1u);
}

TEST_F(JournalTest, AnIdStandsForOneTouchOnly) {
  auto journal = OpenWithSession();
  ASSERT_TRUE(journal->Begin("s", "a", "cup", "+z", "command").ok());
  EXPECT_TRUE(absl::IsAlreadyExists(journal->Begin("s", "a", "mug", "+z", "command").status()));
  EXPECT_TRUE(absl::IsAlreadyExists(journal->Begin("s", "a", "cup", "+z", "other").status()));
  const absl::Status under_way = journal->Begin("s", "a", "cup", "+z", "command").status();
  EXPECT_TRUE(absl::IsAborted(under_way));
  EXPECT_THAT(Message(under_way), HasSubstr("touch 'a' of session 's' is begun"));
  // The same id of another session is another touch.
  ASSERT_TRUE(journal->EnsureSession(SessionNamed("t")).ok());
  EXPECT_TRUE(journal->Begin("t", "a", "mug", "+z", "other").ok());
}

TEST_F(JournalTest, TheOrderOfCovariatesMakesNoOtherCommand) {
  auto journal = OpenWithSession();
  v1::CommandedTouch one, two;
  (*one.mutable_covariates())["cov_a"] = 1;
  (*two.mutable_covariates())["cov_b"] = 2;
  // Concatenated messages merge: the same command with its covariates in either order.
  const std::string ab = one.SerializeAsString() + two.SerializeAsString();
  const std::string ba = two.SerializeAsString() + one.SerializeAsString();
  ASSERT_NE(ab, ba);
  ASSERT_TRUE(journal->Begin("s", "a", "cup", "+z", ab).ok());
  EXPECT_TRUE(absl::IsAborted(journal->Begin("s", "a", "cup", "+z", ba).status()));
  EXPECT_TRUE(absl::IsAlreadyExists(journal->Begin("s", "a", "cup", "+z", one.SerializeAsString()).status()));
}

TEST_F(JournalTest, AFailedTouchMayBeTriedAgainAndThenStandsWhereItWasMade) {
  auto journal = OpenWithSession();
  ASSERT_TRUE(journal->Begin("s", "a", "cup", "+z", "1").ok());
  ASSERT_TRUE(journal->Executing("s", "a", 5, 6).ok());
  ASSERT_TRUE(journal->Failed("s", "a", "protective stop").ok());
  EXPECT_EQ((*journal->Find("s", "a"))->error, "protective stop");
  ASSERT_TRUE(journal->Begin("s", "b", "mug", "+z", "2").ok());
  const auto again = journal->Begin("s", "a", "cup", "-z", "1");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->attempt, 2);
  EXPECT_EQ(again->number, 2u);
  EXPECT_EQ(again->program_id, 0u);
  const auto found = *journal->Find("s", "a");
  EXPECT_EQ(found->up_face, "-z");
  EXPECT_EQ(found->error, "");
  EXPECT_EQ(found->stage, TouchStage::kIntent);
  std::vector<std::string> order;
  ASSERT_TRUE(journal
                  ->ForEachTouch("s",
                                 [&](const JournalTouch& touch) {
                                   order.push_back(touch.id);
                                   return true;
                                 })
                  .ok());
  EXPECT_THAT(order, ElementsAre("b", "a"));
}

TEST_F(JournalTest, StagesAreNotSkipped) {
  auto journal = OpenWithSession();
  ASSERT_TRUE(journal->Begin("s", "a", "cup", "+z", "1").ok());
  const absl::Status early = journal->Done("s", "a", ResultOf(1));
  EXPECT_TRUE(absl::IsFailedPrecondition(early));
  EXPECT_THAT(Message(early), HasSubstr("touch 'a' of session 's' cannot be done: it is begun"));
  ASSERT_TRUE(journal->Executing("s", "a", 1, 1).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(journal->Executing("s", "a", 1, 1)));
  JournalResult short_result = ResultOf(1);
  short_result.fingers.pop_back();
  EXPECT_TRUE(absl::IsInvalidArgument(journal->Done("s", "a", short_result)));
  EXPECT_EQ((*journal->Find("s", "a"))->stage, TouchStage::kExecuting);
  ASSERT_TRUE(journal->Done("s", "a", ResultOf(1)).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(journal->Done("s", "a", ResultOf(2))));
  EXPECT_TRUE(absl::IsFailedPrecondition(journal->Failed("s", "a", "late")));
  EXPECT_EQ((*journal->Find("s", "a"))->result.fingers[0].contact_time_s, 1);
  EXPECT_TRUE(absl::IsNotFound(journal->Executing("s", "b", 1, 1)));
}

TEST_F(JournalTest, SessionsTellWhatTheyHold) {
  auto journal = OpenWithSession();
  for (const char* id : {"a", "b", "c"})
    ASSERT_TRUE(journal->Begin("s", id, *id == 'a' ? "mug" : "cup", "+z", id).ok());
  ASSERT_TRUE(journal->Executing("s", "a", 1, 1).ok());
  ASSERT_TRUE(journal->Done("s", "a", ResultOf(1)).ok());
  ASSERT_TRUE(journal->Failed("s", "b", "why").ok());
  JournalImage image;
  image.png = std::string("\x89PNG\0bytes", 10);
  image.width = 4;
  image.base_from_camera = {1, 2, 3, 0.1, 0.2, 0.3};
  ASSERT_TRUE(journal->AddImage("s", image).ok());
  const auto session = journal->Session("s");
  ASSERT_TRUE(session.ok()) << session.status();
  EXPECT_EQ(session->touches, 3u);
  EXPECT_EQ(session->done, 1u);
  EXPECT_EQ(session->failed, 1u);
  EXPECT_EQ(session->images, 1u);
  EXPECT_THAT(session->objects, ElementsAre("mug", "cup"));
  EXPECT_EQ(session->provenance, "emulated rig");
  EXPECT_EQ(session->calibration, "touchstone: calibration/1\n");
  ASSERT_TRUE(journal
                  ->ForEachImage("s",
                                 [&](const JournalImage& kept) {
                                   EXPECT_EQ(kept.id, "image-0");
                                   EXPECT_EQ(kept.png, image.png);
                                   EXPECT_EQ(kept.base_from_camera, image.base_from_camera);
                                   return true;
                                 })
                  .ok());
  EXPECT_EQ(journal->Sessions()->size(), 1u);
}

TEST_F(JournalTest, ASessionKeepsItsFingers) {
  auto journal = OpenWithSession();
  EXPECT_TRUE(journal->EnsureSession(SessionNamed("s")).ok());
  JournalSession other = SessionNamed("s");
  other.fingers = 5;
  const absl::Status status = journal->EnsureSession(other);
  EXPECT_TRUE(absl::IsFailedPrecondition(status));
  EXPECT_THAT(Message(status), HasSubstr("3 fingers 30 mm apart, not 5 fingers"));
  EXPECT_TRUE(absl::IsInvalidArgument(journal->EnsureSession(SessionNamed(""))));
  const absl::Status unknown = journal->Begin("t", "a", "cup", "+z", "1").status();
  EXPECT_TRUE(absl::IsNotFound(unknown));
  EXPECT_THAT(Message(unknown), HasSubstr(path_ + ": there is no session 't'"));
}

TEST_F(JournalTest, ADeletedSessionIsGoneButNoneThatMoves) {
  auto journal = OpenWithSession();
  ASSERT_TRUE(journal->Begin("s", "a", "cup", "+z", "1").ok());
  ASSERT_TRUE(journal->Executing("s", "a", 1, 1).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(journal->DeleteSession("s", "ana")));
  ASSERT_TRUE(journal->Done("s", "a", ResultOf(1)).ok());
  ASSERT_TRUE(journal->DeleteSession("s", "ana").ok());
  EXPECT_TRUE(absl::IsNotFound(journal->Session("s").status()));
  ASSERT_TRUE(journal->EnsureSession(SessionNamed("s")).ok());
  EXPECT_EQ(journal->Session("s")->touches, 0u);
  EXPECT_EQ(journal->Begin("s", "a", "mug", "+z", "2")->number, 0u);
}

TEST_F(JournalTest, ACopyHasAllThatTheSessionHas) {
  auto journal = OpenWithSession();
  for (const char* id : {"a", "b"}) ASSERT_TRUE(journal->Begin("s", id, "cup", "+z", id).ok());
  ASSERT_TRUE(journal->Executing("s", "a", 8, 9).ok());
  ASSERT_TRUE(journal->Done("s", "a", ResultOf(1)).ok());
  ASSERT_TRUE(journal->Failed("s", "b", "why").ok());
  JournalImage image;
  image.id = "front";
  image.png = "png";
  ASSERT_TRUE(journal->AddImage("s", image).ok());
  const std::string copy_path = folder_ + "/copy.db";
  {
    auto copy = Open(Journal::Mode::kCreateOrReadWrite, copy_path);
    ASSERT_TRUE(journal->CopySession("s", copy.get()).ok());
    EXPECT_TRUE(absl::IsAlreadyExists(journal->CopySession("s", copy.get())));
  }
  EXPECT_TRUE(absl::IsInvalidArgument(journal->CopySession("s", journal.get())));
  auto copy = Open(Journal::Mode::kReadOnly, copy_path);
  const auto session = copy->Session("s");
  ASSERT_TRUE(session.ok()) << session.status();
  EXPECT_EQ(session->done, 1u);
  EXPECT_EQ(session->failed, 1u);
  EXPECT_EQ(session->images, 1u);
  EXPECT_EQ(session->created_unix_s, 1.7e9);
  const auto touch = *copy->Find("s", "a");
  ASSERT_TRUE(touch.has_value());
  EXPECT_EQ(touch->program_id, 8u);
  EXPECT_EQ(touch->result.fingers[2].contact_time_s, ResultOf(1).fingers[2].contact_time_s);
  EXPECT_EQ((*copy->Find("s", "b"))->error, "why");
}

TEST_F(JournalTest, FinishedTouchesComeTogetherOrNotAtAll) {
  auto journal = OpenWithSession();
  ASSERT_TRUE(journal->Begin("s", "c", "cup", "+z", "c").ok());
  std::vector<JournalTouch> touches(3);
  for (int i = 0; i < 3; ++i) {
    touches[i].id = std::string(1, 'a' + i);
    touches[i].object = "cup";
    touches[i].stage = TouchStage::kDone;
    touches[i].result = ResultOf(i);
    touches[i].round = i;
  }
  EXPECT_TRUE(absl::IsAlreadyExists(journal->AddFinished("s", touches)));
  EXPECT_EQ(journal->Session("s")->touches, 1u);
  touches.pop_back();
  ASSERT_TRUE(journal->AddFinished("s", touches).ok());
  const auto touch = *journal->Find("s", "b");
  EXPECT_EQ(touch->number, 2u);
  EXPECT_EQ(touch->round, 1);
  EXPECT_FALSE(touch->face.has_value());
  touches[0].id = "d";
  touches[0].stage = TouchStage::kExecuting;
  EXPECT_TRUE(absl::IsInvalidArgument(journal->AddFinished("s", {touches[0]})));
}

TEST_F(JournalTest, FactsOutliveTheProcess) {
  {
    auto journal = Open();
    EXPECT_EQ(*journal->Metadata("mounted_object"), "");
    ASSERT_TRUE(journal->SetMetadata("mounted_object", "cup").ok());
    ASSERT_TRUE(journal->SetMetadata("mounted_object", "mug").ok());
  }
  EXPECT_EQ(*Open()->Metadata("mounted_object"), "mug");
}

TEST_F(JournalTest, WhatIsToldMayUseTheJournal) {
  auto journal = OpenWithSession();
  for (const char* id : {"a", "b", "c"}) ASSERT_TRUE(journal->Begin("s", id, "cup", "+z", id).ok());
  int told = 0;
  ASSERT_TRUE(journal
                  ->ForEachTouch("s",
                                 [&](const JournalTouch& touch) {
                                   EXPECT_TRUE(journal->Failed("s", touch.id, "again").ok());
                                   EXPECT_TRUE(journal->Begin("s", touch.id, "cup", "+z", touch.id).ok());
                                   return ++told < 2;
                                 })
                  .ok());
  EXPECT_EQ(told, 2);
}

TEST_F(JournalTest, ThreadsShareAJournal) {
  auto journal = OpenWithSession();
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      for (int i = 0; i < 10; ++i) {
        const std::string id = std::to_string(t) + "-" + std::to_string(i);
        ASSERT_TRUE(journal->Begin("s", id, "cup", "+z", id).ok());
        ASSERT_TRUE(journal->Executing("s", id, 1, 1).ok());
        ASSERT_TRUE(journal->Done("s", id, ResultOf(i)).ok());
        ASSERT_TRUE(journal->Session("s").ok());
      }
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(journal->Session("s")->done, 40u);
  std::vector<uint64_t> numbers;
  ASSERT_TRUE(journal
                  ->ForEachTouch("s",
                                 [&](const JournalTouch& touch) {
                                   numbers.push_back(touch.number);
                                   return true;
                                 })
                  .ok());
  for (size_t i = 0; i < numbers.size(); ++i) EXPECT_EQ(numbers[i], i);
}

}  // namespace
}  // namespace touchstone::session
