#include "server/gateway/arm/protocol/rtde_message.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "server/gateway/arm/protocol/big_endian.h"
#include "server/gateway/arm/protocol/primary_message.h"

namespace touchstone::gateway::arm {
namespace {

using ::testing::HasSubstr;

std::string SamplePayload(double timestamp_s, bool with_tcp_offset = true) {
  BigEndianWriter writer;
  writer.U8(1).F64(timestamp_s);
  for (int i = 0; i < 30; ++i) writer.F64(0.125 * i);
  writer.I32(7).I32(3).U32(2).U32(3).U32(4).F64(0.75).F64(0.5).I32(17).I32(-1);
  for (int i = 0; with_tcp_offset && i < 6; ++i) writer.F64(0.5 * i);
  if (with_tcp_offset) writer.I32(123);
  return writer.bytes();
}

TEST(RtdeMessage, GoesOverTheLineAsTheProtocolSays) {
  EXPECT_EQ(EncodeRtde(RtdeType::kVersion, std::string("\0\2", 2)), std::string("\0\5V\0\2", 5));
  EXPECT_EQ(EncodeInputs(2, 258, 69), std::string("\0\14U\2\0\0\1\2\0\0\0E", 12));
}

TEST(RtdeMessage, SampleIsReadInTheOrderOfItsNames) {
  const auto sample = ParseSample(SamplePayload(41.5), 1, true);
  ASSERT_TRUE(sample.ok()) << sample.status();
  EXPECT_EQ(sample->timestamp_s, 41.5);
  EXPECT_EQ(sample->actual_q_rad[5], 0.125 * 5);
  EXPECT_EQ(sample->actual_tcp_speed[5], 0.125 * 23);
  EXPECT_EQ(sample->actual_tcp_force[5], 0.125 * 29);
  EXPECT_EQ(sample->robot_mode, 7);
  EXPECT_EQ(sample->safety_mode, 3);
  EXPECT_EQ(sample->speed_scaling, 0.75);
  EXPECT_EQ(sample->target_speed_fraction, 0.5);
  EXPECT_EQ(sample->program_register, 17);
  EXPECT_EQ(sample->phase_register, -1);
  EXPECT_EQ(sample->tcp_offset[5], 2.5);
  EXPECT_EQ(sample->heartbeat_echo, 123);
}

TEST(RtdeMessage, SampleThatIsCutOrOfAnotherRecipeIsRefused) {
  const std::string whole = SamplePayload(41.5);
  for (size_t size = 0; size < whole.size(); ++size)
    EXPECT_FALSE(ParseSample(whole.substr(0, size), 1, true).ok());
  EXPECT_FALSE(ParseSample(whole + "x", 1, true).ok());
  EXPECT_FALSE(ParseSample(whole, 2, true).ok());
  EXPECT_FALSE(ParseSample(SamplePayload(std::numeric_limits<double>::quiet_NaN()), 1, true).ok());
}

TEST(RtdeMessage, RefusedRecipeNamesTheFields) {
  const auto in_use = ParseInputRecipe("\1IN_USE,INT32");
  ASSERT_FALSE(in_use.ok());
  EXPECT_THAT(std::string(in_use.status().message()), HasSubstr("input_int_register_24: IN_USE"));
  EXPECT_THAT(std::string(in_use.status().message()), HasSubstr("another RTDE client"));
  EXPECT_FALSE(ParseInputRecipe("").ok());
  EXPECT_FALSE(ParseInputRecipe("\1INT32").ok());
  EXPECT_EQ(ParseInputRecipe("\1INT32,INT32,").value(), 1) << "a trailing comma is fine";
}

TEST(RtdeFramer, FindsMessagesHoweverTheStreamIsCut) {
  const std::string bytes = EncodeRtde(RtdeType::kStart, "\1") +
                            EncodeRtde(RtdeType::kData, SamplePayload(1)) + EncodeRtde(RtdeType::kPause, "");
  for (size_t piece = 1; piece < 40; ++piece) {
    RtdeFramer framer;
    std::string types;
    for (size_t begin = 0; begin < bytes.size(); begin += piece) {
      framer.Append(bytes.substr(begin, piece));
      for (auto message = framer.Next(); message.value().has_value(); message = framer.Next())
        types.push_back(static_cast<char>((*message)->type));
    }
    EXPECT_EQ(types, "SUP") << piece;
  }
}

TEST(RtdeFramer, SizeBelowTheHeadersIsAnError) {
  RtdeFramer framer;
  framer.Append(std::string("\0\2U", 3));
  EXPECT_EQ(framer.Next().status().code(), absl::StatusCode::kDataLoss);
}

TEST(RtdeMessage, GarbageNeverBreaksAParser) {
  std::mt19937_64 random(7);
  for (int i = 0; i < 20000; ++i) {
    std::string bytes(random() % 60, '\0');
    for (char& byte : bytes) byte = static_cast<char>(random() % 4 == 0 ? random() : random() % 8);
    ParseSample(bytes, 1, i % 2 == 0).status().IgnoreError();
    ParseText(bytes).status().IgnoreError();
    ParseControllerVersion(bytes).status().IgnoreError();
    PrimaryStream stream;
    stream.Append(bytes);
    for (auto update = stream.Next(); update.ok() && update->has_value(); update = stream.Next()) {
    }
  }
}

std::string Package(uint8_t type, const std::string& body) {
  return BigEndianWriter().I32(static_cast<int32_t>(body.size() + 5)).U8(type).Bytes(body).bytes();
}

TEST(PrimaryStream, UnderstandsWhatStartsStopsAndFails) {
  PrimaryStream stream;
  const std::string head = BigEndianWriter().U64(0).U8(9).bytes();
  stream.Append(Package(
      20, head + BigEndianWriter().U8(7).I32(0).I32(0).U8(19).Bytes("PROGRAM_XXX_STARTEDtouch_5").bytes()));
  stream.Append(
      Package(20, head + BigEndianWriter().U8(10).I32(3).I32(7).Bytes("name 'fo' is not defined").bytes()));
  const auto started = stream.Next();
  ASSERT_TRUE(started.ok() && started->has_value());
  EXPECT_EQ((*started)->started, "touch_5");
  EXPECT_FALSE((*started)->is_error);
  const auto failed = stream.Next();
  ASSERT_TRUE(failed.ok() && failed->has_value());
  EXPECT_TRUE((*failed)->is_exception);
  EXPECT_EQ((*failed)->message, "line 3, column 7: name 'fo' is not defined");
  EXPECT_FALSE(stream.Next()->has_value());
}

TEST(PrimaryStream, ReadsTheArmsOwnKinematics) {
  BigEndianWriter body;
  for (int i = 0; i < 6; ++i) body.U32(0);
  for (int i = 0; i < 24; ++i) body.F64(i);
  body.U32(0);
  PrimaryStream stream;
  const std::string part = Package(5, body.bytes());
  EXPECT_EQ(part.size(), 225u);
  stream.Append(Package(16, Package(0, std::string(42, '\0')) + part));
  const auto update = stream.Next();
  ASSERT_TRUE(update.ok() && update->has_value() && (*update)->kinematics.has_value());
  EXPECT_EQ((*(*update)->kinematics)[1].theta_rad, 1);
  EXPECT_EQ((*(*update)->kinematics)[1].a_m, 7);
  EXPECT_EQ((*(*update)->kinematics)[1].d_m, 13);
  EXPECT_EQ((*(*update)->kinematics)[5].alpha_rad, 23);
}

TEST(PrimaryStream, PackageOfImpossibleSizeIsAnError) {
  PrimaryStream stream;
  stream.Append(std::string("\377\377\377\377\20", 5));
  EXPECT_EQ(stream.Next().status().code(), absl::StatusCode::kDataLoss);
}

}  // namespace
}  // namespace touchstone::gateway::arm
