#include "server/source/request_checks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace touchstone::source {
namespace {

using testing::HasSubstr;

std::string Message(const absl::Status& status) {
  return std::string(status.message());
}

TEST(RequestChecks, TouchesAreAtLeastOneAndAtMostTheLimit) {
  SourceLimits limits;
  limits.max_touches_per_request = 3;
  EXPECT_TRUE(CheckTouchCount(3, limits).ok());
  EXPECT_THAT(Message(CheckTouchCount(0, limits)), HasSubstr("touches is empty"));
  EXPECT_THAT(Message(CheckTouchCount(4, limits)), HasSubstr("touches has 4: at most 3"));
  EXPECT_TRUE(absl::IsResourceExhausted(CheckTouchCount(4, limits)));
  EXPECT_THAT(Message(CheckTouchCount(4, limits)), HasSubstr("(max_touches_per_request)"));
  EXPECT_TRUE(CheckTouchCount(0, limits, 0).ok());
}

TEST(RequestChecks, IdsAreNoneOrOnePerTouchOf1To256PrintableBytes) {
  EXPECT_TRUE(CheckTouchIds({}, 2).ok());
  EXPECT_TRUE(CheckTouchIds({"a", std::string(256, 'b')}, 2).ok());
  EXPECT_THAT(Message(CheckTouchIds({"a"}, 2)), HasSubstr("touch_ids has 1"));
  EXPECT_THAT(Message(CheckTouchIds({"a", ""}, 2)), HasSubstr("touch_ids[1] has 0 bytes"));
  EXPECT_THAT(Message(CheckTouchIds({std::string(257, 'b')}, 1)), HasSubstr("touch_ids[0] has 257 bytes"));
  EXPECT_THAT(Message(CheckTouchIds({"a\nb"}, 1)), HasSubstr("printable"));
}

TEST(RequestChecks, ViewsFitIntoOneAnswer) {
  SourceLimits limits;
  dataset::DatasetImage image;
  image.options.width = image.options.height = 1024;
  EXPECT_TRUE(CheckViews(64, image, limits).ok());  // 3 bytes per pixel: 192 MiB
  EXPECT_THAT(Message(CheckViews(65, image, limits)), HasSubstr("too much for one answer"));
  image.options.depth = true;
  EXPECT_THAT(Message(CheckViews(64, image, limits)), HasSubstr("too much for one answer"));
  EXPECT_THAT(Message(CheckViews(0, image, limits)), HasSubstr("views is empty"));
  EXPECT_THAT(Message(CheckViews(1001, image, limits)), HasSubstr("views has 1001: at most 1000"));
}

TEST(RequestChecks, SessionsHavePlainNamesOrTheDefaultOne) {
  EXPECT_EQ(*SessionName(""), "default");
  EXPECT_EQ(*SessionName("bench_2.monday"), "bench_2.monday");
  for (const char* name : {".hidden", "a/b", "with space"})
    EXPECT_THAT(Message(SessionName(name).status()), HasSubstr("session = '"));
  EXPECT_FALSE(SessionName(std::string(65, 'a')).ok());
}

TEST(RequestChecks, BatchesHaveAtMostTheLimit) {
  SourceLimits limits;
  limits.max_batch_size = 10;
  EXPECT_TRUE(CheckBatchSize(10, limits).ok());
  EXPECT_THAT(Message(CheckBatchSize(11, limits)), HasSubstr("batch_size = 11: at most 10"));
}

}  // namespace
}  // namespace touchstone::source
