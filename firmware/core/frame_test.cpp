#include "firmware/core/frame.h"

#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "firmware/core/messages.h"

namespace touchstone::firmware {
namespace {

using Bytes = std::vector<uint8_t>;

template <typename Message>
Bytes FrameOf(const Message& message) {
  uint8_t payload[kMaxPayload];
  uint8_t frame[kMaxFrame];
  const size_t size = EncodeFrame(payload, Encode(message, payload), frame);
  return Bytes(frame, frame + size);
}

Event EventOf(uint32_t number) {
  Event event;
  event.number = number;
  event.touch = 1000 + number;
  event.finger = static_cast<uint8_t>(number % kMaxFingers);
  event.ticks = uint64_t{number} * 77777777;
  return event;
}

// The numbers of the events that a host would believe; every other field must be as it was sent.
std::vector<uint32_t> Heard(const Bytes& line, FrameParser* parser) {
  std::vector<uint32_t> numbers;
  for (uint8_t byte : line) {
    Event event;
    if (!parser->Push(byte) || !Decode(parser->payload(), parser->size(), &event)) continue;
    const Event truth = EventOf(event.number);
    EXPECT_EQ(event.touch, truth.touch);
    EXPECT_EQ(event.finger, truth.finger);
    EXPECT_EQ(event.ticks, truth.ticks);
    numbers.push_back(event.number);
  }
  return numbers;
}

void Append(const Bytes& more, Bytes* line) {
  line->insert(line->end(), more.begin(), more.end());
}

TEST(Frame, CarriesEverySizeOfPayloadAndEveryByte) {
  std::mt19937 random(1);
  FrameParser parser;
  for (size_t size = 1; size <= kMaxPayload; ++size) {
    for (int kind = 0; kind < 4; ++kind) {
      Bytes payload(size);
      for (uint8_t& byte : payload) {
        byte = static_cast<uint8_t>(kind == 0 ? 0 : kind == 1 ? 0xFF : kind == 2 ? random() : random() % 2);
      }
      uint8_t frame[kMaxFrame];
      const size_t frame_size = EncodeFrame(payload.data(), size, frame);
      ASSERT_EQ(frame_size, size + 4);
      for (size_t i = 0; i < frame_size; ++i) {
        ASSERT_EQ(frame[i] == 0, i + 1 == frame_size);
        ASSERT_EQ(parser.Push(frame[i]), i + 1 == frame_size);
      }
      ASSERT_EQ(Bytes(parser.payload(), parser.payload() + parser.size()), payload);
    }
  }
  EXPECT_EQ(parser.bad_frames(), 0u);
}

TEST(Frame, RefusesToEncodeNothingAndTooMuch) {
  uint8_t payload[kMaxPayload + 1] = {};
  uint8_t frame[kMaxFrame];
  EXPECT_EQ(EncodeFrame(payload, 0, frame), 0u);
  EXPECT_EQ(EncodeFrame(payload, kMaxPayload + 1, frame), 0u);
}

TEST(FrameParser, DoesNotCountEmptyPiecesAsBad) {
  FrameParser parser;
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(parser.Push(0));
  EXPECT_EQ(parser.bad_frames(), 0u);
}

TEST(FrameParser, CountsAPieceThatNeverEndsOnce) {
  FrameParser parser;
  for (int i = 0; i < 100000; ++i) EXPECT_FALSE(parser.Push(0x55));
  EXPECT_FALSE(parser.Push(0));
  EXPECT_EQ(parser.bad_frames(), 1u);
  EXPECT_EQ(Heard(FrameOf(EventOf(3)), &parser), std::vector<uint32_t>{3});
}

TEST(FrameParser, LosesOneFrameAtMostToAByteThatComesTwiceOrNot) {
  const Bytes frame = FrameOf(EventOf(5));
  for (size_t at = 0; at < frame.size(); ++at) {
    for (bool twice : {true, false}) {
      Bytes line = frame;
      if (twice) {
        line.insert(line.begin() + static_cast<long>(at), line[at]);
      } else {
        line.erase(line.begin() + static_cast<long>(at));
      }
      // A lost delimiter takes the next frame along; the one after it is heard in any case.
      Append(FrameOf(EventOf(6)), &line);
      Append(FrameOf(EventOf(7)), &line);
      FrameParser parser;
      const std::vector<uint32_t> heard = Heard(line, &parser);
      ASSERT_FALSE(heard.empty());
      EXPECT_EQ(heard.back(), 7u);
      if (at + 1 < frame.size()) {
        EXPECT_EQ(heard, (std::vector<uint32_t>{6, 7})) << "byte " << at;
      }
    }
  }
}

TEST(FrameParser, IsInStepAgainAtTheNextFrameAfterAnyNoise) {
  std::mt19937 random(2);
  for (int trial = 0; trial < 20000; ++trial) {
    Bytes noise(random() % 300);
    const int kind = static_cast<int>(random() % 3);
    for (uint8_t& byte : noise)
      byte = static_cast<uint8_t>(kind == 0 ? random() : kind == 1 ? 0xFF : random() % 3);

    // Before, between and in the middle of frames.
    Bytes line;
    if (trial % 3 == 0) {
      line = noise;
      Append({0}, &line);
    } else if (trial % 3 == 1) {
      Append(FrameOf(EventOf(1)), &line);
      Append(noise, &line);
      Append(FrameOf(EventOf(2)), &line);
    } else {
      line = FrameOf(EventOf(1));
      line.insert(line.begin() + 1 + static_cast<long>(random() % (line.size() - 1)), noise.begin(),
                  noise.end());
    }
    Append(FrameOf(EventOf(8)), &line);
    Append(FrameOf(EventOf(9)), &line);
    FrameParser parser;
    const std::vector<uint32_t> heard = Heard(line, &parser);
    ASSERT_GE(heard.size(), 2u);
    ASSERT_EQ(heard[heard.size() - 2], 8u);
    ASSERT_EQ(heard.back(), 9u);
  }
}

TEST(Messages, ChangeNothingWhenTheyDoNotDecode) {
  uint8_t payload[kMaxPayload];
  Event wrong = EventOf(4);
  wrong.finger = kMaxFingers;
  const size_t size = Encode(wrong, payload);
  Event event = EventOf(9);
  EXPECT_FALSE(Decode(payload, size, &event));
  EXPECT_EQ(event.number, 9u);
}

// Fields out of their range, each with a right check.
TEST(Messages, RefuseValuesOutOfTheirRange) {
  uint8_t payload[kMaxPayload];
  const auto refuses = [&](auto message) { return !Decode(payload, Encode(message, payload), &message); };
  Event event = EventOf(1);
  EXPECT_FALSE(refuses(event));
  event.number = 0;
  EXPECT_TRUE(refuses(event));
  event = EventOf(1), event.touch = kNoTouch;
  EXPECT_TRUE(refuses(event));
  event = EventOf(1), event.kind = static_cast<EventKind>(3);
  EXPECT_TRUE(refuses(event));
  event = EventOf(1), event.ticks = kMaxTicks + 1;
  EXPECT_TRUE(refuses(event));

  Configure configure;
  EXPECT_TRUE(refuses(configure));  // no finger
  configure.fingers = kMaxFingers;
  EXPECT_FALSE(refuses(configure));
  configure.finger[7].debounce_us = kMaxDebounceUs + 1;
  EXPECT_TRUE(refuses(configure));
  configure.finger[7] = FingerConfig{};
  configure.finger[0].sensor = Sensor::kResistor;
  configure.finger[0].hysteresis = configure.finger[0].threshold;
  EXPECT_TRUE(refuses(configure));
  configure.finger[0] = FingerConfig{};
  configure.finger[3].active_level = 2;
  EXPECT_TRUE(refuses(configure));

  EXPECT_TRUE(refuses(Arm{kNoTouch}));
  EXPECT_TRUE(refuses(ClockReply{1, 20, 19}));
  Recalled record;
  record.touch = 1;
  record.fingers = 3;
  EXPECT_FALSE(refuses(record));
  record.contact_mask = 8;  // a fourth finger
  EXPECT_TRUE(refuses(record));
  record.contact_mask = 1;
  record.ticks[2] = 5;  // a time without a contact
  EXPECT_TRUE(refuses(record));
  EXPECT_TRUE(refuses(HelloReply{}));  // a clock of 0 Hz
}

}  // namespace
}  // namespace touchstone::firmware
