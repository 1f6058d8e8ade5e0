// What a connection may ask for, frame by frame.
#include "server/service/connections/frame_meter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/service/connections/relayed_peer.h"

namespace touchstone::service {
namespace {

using testing::HasSubstr;
using Verdict = FrameMeter::Verdict;

class FrameMeterTest : public testing::Test {
 protected:
  Verdict Send(FrameType type, uint8_t flags, uint32_t stream, absl::string_view payload = "") {
    return meter_.FromClient({static_cast<uint32_t>(payload.size()), type, flags, stream}, payload, now_);
  }
  Verdict Begin(uint32_t stream) { return Send(FrameType::kHeaders, kEndHeaders, stream, "x"); }
  Verdict Reset(uint32_t stream) { return Send(FrameType::kRstStream, 0, stream, "1234"); }
  void Wait(double seconds) { now_ += std::chrono::milliseconds(static_cast<int>(1e3 * seconds)); }
  // How many of the next ones may be begun and reset at once.
  int Resets(int at_most) {
    for (int k = 0; k < at_most; ++k, stream_ += 2) {
      if (meter_.open_calls() == 0 && Begin(stream_) != Verdict::kPass) return k;
      if (Reset(stream_) != Verdict::kPass) return k;
    }
    return at_most;
  }

  Limits limits_;
  Clock::Time now_{};
  SharedResets shared_{limits_, now_};
  std::shared_ptr<FrameMeter::AddressCalls> calls_ = std::make_shared<FrameMeter::AddressCalls>(0);
  FrameMeter meter_{limits_, &shared_, calls_, now_, false};
  uint32_t stream_ = 1;
};

TEST_F(FrameMeterTest, CallsAreResetNoFasterThanTheLimit) {
  EXPECT_EQ(Resets(10'000), limits_.max_resets_per_s);
  Wait(1);
  EXPECT_EQ(Resets(10'000), limits_.max_resets_per_s);
}

TEST_F(FrameMeterTest, WhoGoesOnIsShutOut) {
  Resets(10'000);
  for (int k = 0; k < 30 && Reset(stream_) != Verdict::kShut; ++k) {
    Wait(1);
    Resets(10'000);
  }
  EXPECT_THAT(meter_.reason(), HasSubstr("max_resets_per_s"));
  EXPECT_THAT(meter_.reason(), HasSubstr("flood_s = 10"));
  EXPECT_LE(now_.time_since_epoch(), std::chrono::seconds(12));
}

TEST_F(FrameMeterTest, WhoPausesIsNotShutOut) {
  for (int k = 0; k < 100; ++k) {
    EXPECT_GT(Resets(10'000), 0);
    EXPECT_EQ(Reset(stream_), Verdict::kLater);
    Wait(1);
    EXPECT_EQ(Reset(stream_), Verdict::kPass);
    meter_.NothingWaits();
  }
}

TEST_F(FrameMeterTest, CallsThatHaveEndedAreNotReset) {
  for (int k = 0; k < 3000; ++k, stream_ += 2) {
    ASSERT_EQ(Begin(stream_), Verdict::kPass);
    meter_.FromServer({0, FrameType::kHeaders, kEndStream, stream_});
    ASSERT_EQ(Reset(stream_), Verdict::kPass);
  }
  EXPECT_EQ(*calls_, 0);
}

TEST_F(FrameMeterTest, CallsThatTheServerResetsAreResets) {
  int begun = 0;
  for (; begun < 10'000 && Begin(stream_) == Verdict::kPass; ++begun, stream_ += 2)
    meter_.FromServer({4, FrameType::kRstStream, 0, stream_});
  EXPECT_EQ(begun, limits_.max_resets_per_s + 1);
}

TEST_F(FrameMeterTest, AllConnectionsShareWhatCanBeClearedAway) {
  int resets = 0;
  std::vector<std::unique_ptr<FrameMeter>> meters;
  for (int k = 0; k < 20; ++k) {
    FrameMeter& meter =
        *meters.emplace_back(std::make_unique<FrameMeter>(limits_, &shared_, calls_, now_, false));
    for (uint32_t stream = 1;; stream += 2, ++resets) {
      meter.FromClient({1, FrameType::kHeaders, kEndHeaders, stream}, "x", now_);
      if (meter.FromClient({4, FrameType::kRstStream, 0, stream}, "1234", now_) != Verdict::kPass) break;
    }
  }
  EXPECT_EQ(resets, SharedResets::kConnections * limits_.max_resets_per_s);
}

TEST_F(FrameMeterTest, HeadersEnd) {
  EXPECT_EQ(Send(FrameType::kHeaders, 0, 1, std::string(16'000, 'x')), Verdict::kPass);
  for (int k = 0; k < 3; ++k)
    EXPECT_EQ(Send(FrameType::kContinuation, 0, 1, std::string(16'000, 'x')), Verdict::kPass);
  EXPECT_EQ(Send(FrameType::kContinuation, 0, 1, std::string(16'000, 'x')), Verdict::kShut);
  EXPECT_THAT(meter_.reason(), HasSubstr("max_header_kib"));
}

TEST_F(FrameMeterTest, HeadersDoNotComeInEmptyFrames) {
  EXPECT_EQ(Send(FrameType::kHeaders, 0, 1), Verdict::kPass);
  int frames = 0;
  while (frames < 1000 && Send(FrameType::kContinuation, 0, 1) == Verdict::kPass) ++frames;
  EXPECT_LT(frames, 64);
}

TEST_F(FrameMeterTest, OtherFramesHaveARate) {
  const auto count = [&](FrameType type) {
    int frames = 0;
    for (; frames < 10'000'000 && Send(type, 0, 0, "12345678") == Verdict::kPass; ++frames)
      meter_.AnswersMove();
    return frames;
  };
  constexpr auto kPing = static_cast<FrameType>(6), kSettings = static_cast<FrameType>(4);
  EXPECT_EQ(count(kPing), 5 * limits_.max_pings_per_s);
  EXPECT_EQ(count(kSettings), 0);
  EXPECT_EQ(count(FrameType::kWindowUpdate), 5 * limits_.max_frames_per_s);
  EXPECT_EQ(Send(FrameType::kData, 0, 1, std::string(1000, 'x')), Verdict::kPass)
      << "data are counted by bytes";
  EXPECT_EQ(Send(FrameType::kData, 0, 1, "x"), Verdict::kLater) << "unless there are few";
  EXPECT_EQ(Send(FrameType::kData, 0, 1), Verdict::kLater) << "or none";
}

TEST_F(FrameMeterTest, WhoTakesNoAnswersMayNotAskForMore) {
  constexpr auto kPing = static_cast<FrameType>(6);
  int pings = 0;
  while (pings < 1'000'000 && Send(kPing, 0, 0, "12345678") == Verdict::kPass) ++pings;
  EXPECT_EQ(pings, 200);
  meter_.AnswersMove();
  EXPECT_EQ(Send(kPing, 0, 0, "12345678"), Verdict::kPass);
}

TEST_F(FrameMeterTest, AnAddressWithManyCallsHasOneMoreOnEachConnection) {
  for (int k = 0; k < limits_.max_calls_per_address; ++k, stream_ += 2)
    ASSERT_EQ(Begin(stream_), Verdict::kPass);
  EXPECT_EQ(Begin(stream_), Verdict::kLater);
  FrameMeter other(limits_, &shared_, calls_, now_, false);
  EXPECT_EQ(other.FromClient({1, FrameType::kHeaders, kEndHeaders, 1}, "x", now_), Verdict::kPass);
  EXPECT_EQ(other.FromClient({1, FrameType::kHeaders, kEndHeaders, 3}, "x", now_), Verdict::kLater);
}

TEST_F(FrameMeterTest, AConnectionForAStopIsForOneStop) {
  // As gRPC's C core writes it, and in the Huffman code of Go and Java.
  for (const absl::string_view path :
       {absl::string_view("/touchstone.v1.Control/Stop"),
        absl::string_view("\x61\x27\xb4\x93\xa1\x27\xa8\xab\xf7\x0a\xf7\x8f\x52\x6c\x3d\x0c\x6e\x49\xeb")}) {
    const std::string block = "\x83\x86\x44" + std::string(path) + "\x5f";
    FrameMeter meter(limits_, &shared_, calls_, now_, true);
    const FrameHead head = {static_cast<uint32_t>(block.size()), FrameType::kHeaders, kEndHeaders, 1};
    EXPECT_EQ(meter.FromClient(head, absl::string_view(block).substr(0, 5), now_), Verdict::kLater);
    EXPECT_EQ(meter.FromClient(head, block, now_), Verdict::kPass);
    EXPECT_EQ(meter.FromClient({head.length, head.type, head.flags, 3}, block, now_), Verdict::kShut);
  }
  FrameMeter meter(limits_, &shared_, calls_, now_, true);
  const std::string other = "/touchstone.v1.Control/GetState";
  EXPECT_EQ(meter.FromClient({static_cast<uint32_t>(other.size()), FrameType::kHeaders, 4, 1}, other, now_),
            Verdict::kShut);
}

TEST(FrameReader, FindsHeadsWhereverTheBytesAreCut) {
  const std::string bytes = std::string(kClientPreface) + FrameOf({0, FrameType::kHeaders, 4, 7}, "headers") +
                            FrameOf({0, FrameType::kData, 1, 7}, "") +
                            FrameOf({0, FrameType::kRstStream, 0, 9}, "1234");
  for (size_t piece = 1; piece < bytes.size(); ++piece) {
    FrameReader reader(kClientPreface.size());
    std::vector<uint32_t> streams;
    std::string waiting, passed;
    for (size_t at = 0; at < bytes.size(); at += piece) {
      waiting += bytes.substr(at, piece);
      const size_t pass = reader.Pass(waiting, [&](const FrameHead& head, absl::string_view) {
        streams.push_back(head.stream);
        return true;
      });
      passed += waiting.substr(0, pass);
      waiting.erase(0, pass);
    }
    EXPECT_EQ(passed, bytes);
    EXPECT_THAT(streams, testing::ElementsAre(7, 7, 9)) << piece;
    EXPECT_TRUE(reader.between_frames());
  }
}

TEST(FrameReader, StopsBeforeAFrameThatIsNotAdmitted) {
  const std::string first = FrameOf({0, FrameType::kData, 0, 1}, "abc");
  FrameReader reader;
  const auto only_first = [](const FrameHead& head, absl::string_view) { return head.stream == 1; };
  EXPECT_EQ(reader.Pass(first + FrameOf({0, FrameType::kData, 0, 3}, "abc"), only_first), first.size());
}

TEST(RelayedPeer, IsTheClientAsGrpcWouldNameIt) {
  for (const std::string peer : {"ipv4:10.0.0.7:4711", "ipv6:%5B::1%5D:4711"})
    EXPECT_EQ(PeerOfTransport("unix-abstract:" + RelayedPeerName(7, peer)), peer);
  EXPECT_EQ(PeerOfTransport("ipv4:10.0.0.7:4711"), "ipv4:10.0.0.7:4711");
}

}  // namespace
}  // namespace touchstone::service
