#include "client/workbench_server/http/grpc_web.h"

#include <gtest/gtest.h>

namespace touchstone::workbench {
namespace {

using std::chrono::nanoseconds;

TEST(GrpcWeb, TakesExactlyOneMessage) {
  EXPECT_EQ(*OneMessage(MessageFrame("abc")), "abc");
  EXPECT_EQ(*OneMessage(MessageFrame("")), "");
  EXPECT_EQ(OneMessage("").status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(OneMessage(MessageFrame("abc").substr(0, 7)).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(OneMessage(MessageFrame("a") + MessageFrame("b")).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(OneMessage(TrailersFrame(grpc::Status(), {})).status().code(),
            absl::StatusCode::kInvalidArgument);
  std::string compressed = MessageFrame("abc");
  compressed[0] = 1;
  EXPECT_EQ(OneMessage(compressed).status().code(), absl::StatusCode::kUnimplemented);
}

TEST(GrpcWeb, WritesTheStatusAsTheLastFrame) {
  const std::string frame =
      TrailersFrame({grpc::StatusCode::NOT_FOUND, "50 % of \xc3\xbc\n"}, {{"a-bin", "\x01"}});
  EXPECT_EQ(static_cast<unsigned char>(frame[0]), 0x80);
  EXPECT_EQ(frame.substr(5), "grpc-status: 5\r\ngrpc-message: 50 %25 of %C3%BC%0A\r\na-bin: AQ\r\n");
}

TEST(GrpcWeb, ReadsTimeouts) {
  EXPECT_EQ(ParseTimeout("100m"), nanoseconds(100'000'000));
  EXPECT_EQ(ParseTimeout("2S"), nanoseconds(2'000'000'000));
  for (const char* wrong : {"", "m", "1", "-1m", "123456789m", "1x", " 1m"})
    EXPECT_FALSE(ParseTimeout(wrong)) << wrong;
}

TEST(GrpcWeb, BridgesWhatAReaderMayDoAtARig) {
  for (const char* let :
       {"/touchstone.v1.Diagnosis/Compare", "/touchstone.v1.Control/Stop", "/touchstone.v1.Rig/GetRig"})
    EXPECT_TRUE(CheckMethod(let).ok()) << let;
  for (const char* refused :
       {"/touchstone.v1.Rig/Home", "/touchstone.v1.Source/Touch", "/touchstone.v1.Control/AcquireLease",
        "/touchstone.v1.Models/CreateModel", "/touchstone.v1.Sessions/DeleteSession"})
    EXPECT_EQ(CheckMethod(refused).code(), absl::StatusCode::kPermissionDenied) << refused;
  for (const char* unknown : {"/other.v1.Diagnosis/Compare", "/Diagnosis/Compare", "/"})
    EXPECT_EQ(CheckMethod(unknown).code(), absl::StatusCode::kUnimplemented) << unknown;
}

TEST(GrpcWeb, KnowsItsContentTypes) {
  EXPECT_TRUE(IsGrpcWebType("application/grpc-web+proto"));
  EXPECT_TRUE(IsGrpcWebType("Application/grpc-web; charset=utf-8"));
  EXPECT_FALSE(IsGrpcWebType("application/grpc-web-text"));
  EXPECT_FALSE(IsGrpcWebType("application/json"));
}

}  // namespace
}  // namespace touchstone::workbench
