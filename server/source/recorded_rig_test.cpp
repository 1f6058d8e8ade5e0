#include "server/source/recorded_rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/test_folder.h"
#include "server/image/encoding/encode.h"
#include "server/session/journal/command_bytes.h"
#include "server/source/test_source.h"

namespace touchstone::source {
namespace {

class RecordedRigTest : public testing::Test {
 protected:
  RecordedRigTest() {
    auto journal =
        *session::Journal::Open(folder_.Path("rig.db"), session::Journal::Mode::kCreateOrReadWrite);
    session::JournalSession session;
    session.name = "monday";
    EXPECT_TRUE(journal->EnsureSession(session).ok());
    std::vector<session::JournalTouch> touches;
    for (int k = 0; k < 3; ++k) {  // the same touch three times
      session::JournalTouch touch;
      touch.id = "touch-" + std::to_string(k);
      touch.object = "lat00";
      touch.command = session::CommandBytes(FromAbove());
      touch.stage = session::TouchStage::kDone;
      for (int finger = 0; finger < 3; ++finger) touch.result.fingers.push_back({1.0 + k, {}, 0});
      touches.push_back(touch);
    }
    EXPECT_TRUE(journal->AddFinished("monday", touches).ok());
    journal.reset();
    rig_ = *RecordedRig::Open(folder_.Path("rig.db"));
  }

  static TouchCommand Command(const std::string& id, const touch::CommandedTouch& touch,
                              uint64_t repeat = 0) {
    TouchCommand command;
    command.id = id;
    command.object = "lat00";
    command.touch = touch;
    command.bytes = session::CommandBytes(touch);
    command.repeat = repeat;
    return command;
  }

  const TestFolder folder_;
  std::unique_ptr<RecordedRig> rig_;
};

TEST_F(RecordedRigTest, GivesATouchByItsIdOrItsRepeatsInTurn) {
  EXPECT_EQ(rig_->Touch(Command("touch-2", FromAbove()), NoObjection)->id, "touch-2");
  for (int repeat : {0, 1, 2, 3})
    EXPECT_EQ(rig_->Touch(Command("new", FromAbove(), repeat), NoObjection)->id,
              "touch-" + std::to_string(repeat % 3));
}

TEST_F(RecordedRigTest, AnIdStandsForItsTouchOnly) {
  const auto other = rig_->Touch(Command("touch-1", FromAbove(0.01)), NoObjection);
  EXPECT_EQ(other.status().code(), absl::StatusCode::kNotFound);
}

TEST_F(RecordedRigTest, SaysWhatWasNotRecorded) {
  EXPECT_FALSE(rig_->moves());
  EXPECT_FALSE(rig_->has_camera());
  ViewCommand view;
  view.object = "lat00";
  EXPECT_EQ(rig_->Photograph(view, NoObjection).status().code(), absl::StatusCode::kNotFound);
}

TEST_F(RecordedRigTest, ShowsAPictureThroughTheLensThatItWasTakenWith) {
  rig_.reset();
  ViewCommand view;
  view.object = "lat00";
  session::JournalImage image;
  image.id = ViewId(view), image.object = "lat00";
  image.width = 4, image.height = 3;
  const std::vector<uint8_t> rgb(4 * 3 * 3, 9);
  image.png = *image::EncodePng(rgb.data(), 4, 3, 3);
  session::JournalView& taken = image.view.emplace();
  taken.fx_px = 6.5, taken.fy_px = 6.4, taken.cx_px = 1.25, taken.cy_px = 1;
  taken.distortion = {-0.2};
  {
    auto journal = *session::Journal::Open(folder_.Path("rig.db"), session::Journal::Mode::kReadWrite);
    ASSERT_TRUE(journal->AddImage("monday", image).ok());
  }
  rig_ = *RecordedRig::Open(folder_.Path("rig.db"));
  const auto photograph = rig_->Photograph(view, NoObjection);
  ASSERT_TRUE(photograph.ok()) << photograph.status();
  const image::Intrinsics lens = rig_->IntrinsicsOf(photograph->frame);
  EXPECT_EQ(lens.fx_px, 6.5);
  EXPECT_EQ(lens.cx_px, 1.25);
  EXPECT_EQ(lens.distortion, std::vector<double>{-0.2});
}

}  // namespace
}  // namespace touchstone::source
