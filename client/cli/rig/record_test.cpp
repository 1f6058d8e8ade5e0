// The local record that makes a run resumable.
#include "client/cli/rig/record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/base/test_folder.h"

namespace touchstone::cli {
namespace {

using ::testing::HasSubstr;

client::MeasuredTouch Touch(uint64_t number, const std::string& object, double x_m = 0) {
  client::MeasuredTouch touch;
  touch.touch = number;
  touch.object = object;
  touch.commanded.mutable_target_m()->set_x(x_m);
  touch.commanded.mutable_approach()->set_z(-1);
  touch.commanded.mutable_lateral()->set_x(1);
  touch.commanded.set_standoff_m(0.06);
  touch.commanded.set_speed_m_s(0.02);
  return touch;
}

class RigRecordTest : public ::testing::Test {
 protected:
  std::unique_ptr<RigRecord> Open() {
    auto record = RigRecord::Open(folder_.Path("session.db"), "monday", v1::RigState());
    EXPECT_TRUE(record.ok()) << record.status();
    return *std::move(record);
  }
  static v1::TouchResult Result() {
    v1::TouchResult result;
    for (const double time_s : {1.0, 1.25, static_cast<double>(NAN)}) result.add_contact_time_s(time_s);
    result.mutable_measured()->set_session_time_s(12.5);
    return result;
  }

  TestFolder folder_;
};

TEST_F(RigRecordTest, WhatIsDoneIsNotAskedForAgain) {
  const client::MeasuredTouch done = Touch(0, "a"), begun = Touch(1, "a", 0.01), failed = Touch(2, "a", 0.02);
  {
    const auto record = Open();
    EXPECT_FALSE(*record->Has("0", done));
    ASSERT_TRUE(record->Begin("0", done, "+z").ok());
    ASSERT_TRUE(record->Done("0", Result()).ok());
    ASSERT_TRUE(record->Begin("1", begun, "+z").ok());
    ASSERT_TRUE(record->Begin("2", failed, "+z").ok());
    ASSERT_TRUE(record->Failed("2", absl::AbortedError("stopped")).ok());
  }
  // As after a kill: one is done, one under way, one failed.
  const auto record = Open();
  EXPECT_TRUE(*record->Has("0", done));
  EXPECT_FALSE(*record->Has("1", begun));
  EXPECT_FALSE(*record->Has("2", failed));
  for (const auto& [id, touch] : {std::pair("1", begun), std::pair("2", failed)}) {
    ASSERT_TRUE(record->Begin(id, touch, "+z").ok());
    ASSERT_TRUE(record->Done(id, Result()).ok());
  }
  const auto touches = record->Touches();
  ASSERT_TRUE(touches.ok()) << touches.status();
  ASSERT_EQ(touches->size(), 3u);
  EXPECT_DOUBLE_EQ((*touches)[0].time_s[1], 1.25);
  EXPECT_TRUE(std::isnan((*touches)[0].time_s[2]));
  EXPECT_DOUBLE_EQ((*touches)[0].commanded.session_time_s(), 12.5);
}

TEST_F(RigRecordTest, AChangedPlanIsRefused) {
  const auto record = Open();
  ASSERT_TRUE(record->Begin("0", Touch(0, "a"), "+z").ok());
  ASSERT_TRUE(record->Done("0", Result()).ok());
  const auto other = record->Has("0", Touch(0, "a", 0.01));
  EXPECT_EQ(other.status().code(), absl::StatusCode::kAlreadyExists);
  EXPECT_THAT(std::string(other.status().message()), HasSubstr("the plan was changed"));
}

TEST(RigRecord, JournalsStandBesideMeasurementFiles) {
  EXPECT_EQ(*JournalPathOf("out/session.db"), "out/session.db");
  EXPECT_EQ(*JournalPathOf("out/set.csv"), "out/set.db");
  EXPECT_EQ(JournalPathOf("out/set.txt").status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace touchstone::cli
