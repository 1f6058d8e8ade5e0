#include "server/gateway/effector/contact_record.h"

#include <gtest/gtest.h>

namespace touchstone::gateway::effector {
namespace {

constexpr uint32_t kTouch = 7;
constexpr uint64_t kLatest = 10000;

firmware::Event ContactOf(int finger, uint64_t ticks) {
  firmware::Event event;
  event.touch = kTouch, event.finger = static_cast<uint8_t>(finger), event.ticks = ticks;
  event.kind = firmware::EventKind::kContact;
  return event;
}

class ContactRecordTest : public testing::Test {
 protected:
  ContactRecordTest() {
    record_.Begin(kTouch, 1, 3);
    firmware::Armed armed;
    armed.touch = kTouch, armed.ticks = 100;
    EXPECT_TRUE(record_.OnArmed(armed, 0, kLatest));
    read_.touch = kTouch, read_.fingers = 3;
  }
  void Contact(int finger, uint64_t ticks) {
    read_.contact_mask = static_cast<uint8_t>(read_.contact_mask | 1 << finger);
    read_.ticks[finger] = ticks;
  }
  void ReadTwice() {
    EXPECT_FALSE(record_.OnReading(read_, kLatest));
    EXPECT_TRUE(record_.OnReading(read_, kLatest));
  }

  ContactRecord record_;
  firmware::Recalled read_;  // what the device would answer
};

TEST_F(ContactRecordTest, IsFinalBeforeItsEndOnlyWithEveryFinger) {
  for (int finger = 0; finger < 3; ++finger) {
    EXPECT_FALSE(record_.Final());
    Contact(finger, 200 + finger);
    EXPECT_EQ(record_.OnEvent(ContactOf(finger, 200 + finger), kLatest), ContactRecord::Verdict::kNew);
  }
  EXPECT_TRUE(record_.NeedsReconciliation());
  ReadTwice();
  EXPECT_TRUE(record_.Final());
  record_.EndCapture();
  EXPECT_TRUE(record_.Final());
}

TEST_F(ContactRecordTest, AContactWhoseEventWasLostAfterAReadingIsFoundAtTheEnd) {
  Contact(0, 200);
  record_.OnEvent(ContactOf(0, 200), kLatest);
  EXPECT_EQ(record_.OnEvent(ContactOf(0, 201), kLatest), ContactRecord::Verdict::kRejected);
  EXPECT_TRUE(record_.NeedsReconciliation()) << "two times of one contact";
  ReadTwice();
  EXPECT_FALSE(record_.Final());
  Contact(1, 300), Contact(2, 310);  // their events never arrive
  record_.EndCapture();
  EXPECT_FALSE(record_.Final()) << "the record was read before these contacts";
  ReadTwice();
  EXPECT_TRUE(record_.Final());
  EXPECT_EQ(record_.touch().Contacts(), 3);
}

TEST_F(ContactRecordTest, AReleaseIsAwaitedOfFingersThatHadContactAndAreFree) {
  EXPECT_FALSE(record_.AwaitsRelease());
  record_.OnEvent(ContactOf(0, 200), kLatest);
  record_.SetPressed(0b001);
  EXPECT_FALSE(record_.AwaitsRelease()) << "it sticks";
  record_.SetPressed(0);
  EXPECT_TRUE(record_.AwaitsRelease());
  firmware::Event release = ContactOf(0, 300);
  release.kind = firmware::EventKind::kRelease;
  EXPECT_EQ(record_.OnEvent(release, kLatest), ContactRecord::Verdict::kNew);
  EXPECT_EQ(record_.OnEvent(release, kLatest), ContactRecord::Verdict::kRepeated);
  release.ticks = 310;
  EXPECT_EQ(record_.OnEvent(release, kLatest), ContactRecord::Verdict::kRejected) << "there is one alone";
  EXPECT_FALSE(record_.AwaitsRelease());
  EXPECT_EQ(record_.touch().release_ticks[0], 300u);
}

}  // namespace
}  // namespace touchstone::gateway::effector
