#include "tests/fuzz/frame_fuzz.h"

#include <algorithm>
#include <random>
#include <vector>

#include "firmware/core/effector.h"

namespace touchstone::fuzz {
namespace {

using namespace touchstone::firmware;
using Bytes = std::vector<uint8_t>;

// True unless the payload is a good message of this type that encodes to other bytes.
template <typename Message>
bool EncodesAlike(const uint8_t* payload, size_t size) {
  Message message;
  if (!Decode(payload, size, &message)) return true;
  uint8_t again[kMaxPayload];
  return Encode(message, again) == size && std::equal(payload, payload + size, again);
}

template <typename... Messages>
bool AllEncodeAlike(const uint8_t* payload, size_t size) {
  return (EncodesAlike<Messages>(payload, size) && ...);
}

bool IsConsistent(const uint8_t* payload, size_t size) {
  return AllEncodeAlike<Hello, HelloReply, Configure, Configured, Arm, Armed, Disarm, Disarmed, Clock,
                        ClockReply, Event, Acknowledge, Recall, Recalled, StatusRequest, Status, Refused>(
      payload, size);
}

// The core with a counter of its own and what it wrote.
struct Device {
  uint32_t counter = 0;
  Bytes written;
  Effector effector{Identity{}, &Write, &Now, this};

  static void Write(void* context, const uint8_t* frame, size_t size) {
    Bytes& written = static_cast<Device*>(context)->written;
    written.insert(written.end(), frame, frame + size);
  }
  static uint32_t Now(void* context) { return static_cast<Device*>(context)->counter; }
};

// Damages pieces of a stream.
class Damage {
 public:
  explicit Damage(uint64_t seed) : random_(seed) {}
  uint64_t Draw(uint64_t count) { return random_() % count; }

  void Apply(Bytes* piece) {
    for (uint64_t times = Draw(4); times > 0; --times) Once(piece);
    if (!piece->empty()) before_ = *piece;
  }

 private:
  size_t Place(const Bytes& piece) { return static_cast<size_t>(Draw(piece.size() + 1)); }
  Bytes Noise() {
    Bytes noise(Draw(Draw(8) == 0 ? 300 : 12));
    const uint64_t kind = Draw(3);
    for (uint8_t& byte : noise)
      byte = static_cast<uint8_t>(kind == 0 ? Draw(256) : kind == 1 ? Draw(3) : 0xFF);
    return noise;
  }
  void Once(Bytes* piece) {
    Bytes& p = *piece;
    if (p.empty()) return;
    const size_t at = static_cast<size_t>(Draw(p.size()));
    const size_t end = at + 1 + static_cast<size_t>(Draw(p.size() - at));
    switch (Draw(10)) {
      case 0:  // one bit
        p[at] = static_cast<uint8_t>(p[at] ^ 1u << Draw(8));
        break;
      case 1:  // several bits
        for (uint64_t bits = 2 + Draw(7); bits > 0; --bits) {
          uint8_t& byte = p[static_cast<size_t>(Draw(p.size()))];
          byte = static_cast<uint8_t>(byte ^ 1u << Draw(8));
        }
        break;
      case 2:  // a byte is another
        p[at] = static_cast<uint8_t>(Draw(256));
        break;
      case 3:  // bytes are lost
        p.erase(p.begin() + static_cast<long>(at), p.begin() + static_cast<long>(Draw(2) ? at + 1 : end));
        break;
      case 4:  // bytes come twice
      {
        const Bytes twice(p.begin() + static_cast<long>(at),
                          p.begin() + static_cast<long>(Draw(2) ? at + 1 : end));
        p.insert(p.begin() + static_cast<long>(at), twice.begin(), twice.end());
        break;
      }
      case 5:  // a burst of noise
      {
        const Bytes noise = Noise();
        p.insert(p.begin() + static_cast<long>(Place(p)), noise.begin(), noise.end());
        break;
      }
      case 6:  // noise over the signal
        for (size_t i = at; i < end; ++i) p[i] = static_cast<uint8_t>(p[i] ^ Draw(256));
        break;
      case 7:  // the rest is cut off
        p.resize(at);
        break;
      case 8:  // the head of this, the tail of what came before
        if (!before_.empty()) {
          const size_t tail = static_cast<size_t>(Draw(before_.size()));
          p.resize(at);
          p.insert(p.end(), before_.begin() + static_cast<long>(tail), before_.end());
        }
        break;
      default:  // bytes change places
        std::swap(p[at], p[static_cast<size_t>(Draw(p.size()))]);
    }
  }

  std::mt19937_64 random_;
  Bytes before_;
};

// One receiver: what it accepts must be among what the other end sent.
class Ear {
 public:
  // Splits undamaged frames off, and keeps what they say.
  void Sent(const Bytes& frames) {
    for (uint8_t byte : frames) {
      if (sender_.Push(byte)) sent_.emplace_back(sender_.payload(), sender_.payload() + sender_.size());
    }
  }
  // False if something is accepted that was never sent.
  template <typename Accept>
  bool Hear(const Bytes& bytes, Counts* counts, Accept accept) {
    for (uint8_t byte : bytes) {
      const uint32_t bad = parser_.bad_frames();
      const bool good = parser_.Push(byte);
      counts->damaged_frames += parser_.bad_frames() - bad;
      if (!good) continue;
      if (!IsIntact(parser_.payload(), parser_.size())) {
        ++counts->slipped_frames;
        continue;
      }
      ++counts->good_frames;
      const Bytes payload(parser_.payload(), parser_.payload() + parser_.size());
      if (std::find(sent_.begin(), sent_.end(), payload) == sent_.end()) return false;
      accept(payload);
    }
    return true;
  }

 private:
  FrameParser sender_, parser_;
  std::vector<Bytes> sent_;
};

struct Edge {
  int finger;
  bool pressed;
  uint64_t ticks;
};

template <typename Message>
Bytes Frame(const Message& message) {
  uint8_t payload[kMaxPayload];
  uint8_t frame[kMaxFrame];
  const size_t size = EncodeFrame(payload, Encode(message, payload), frame);
  return Bytes(frame, frame + size);
}

Bytes DrawRequest(Damage* damage, uint32_t number) {
  const uint32_t any = static_cast<uint32_t>(1 + damage->Draw(4));
  switch (damage->Draw(9)) {
    case 0:
      return Frame(Hello{});
    case 1: {
      Configure configure;
      configure.fingers = static_cast<uint8_t>(1 + damage->Draw(kMaxFingers));
      return Frame(configure);
    }
    case 2:
    case 3:
      return Frame(Arm{any});
    case 4:
      return Frame(Disarm{});
    case 5:
      return Frame(Clock{number});
    case 6:
      return Frame(Acknowledge{any});
    case 7:
      return Frame(Recall{any});
    default:
      return Frame(StatusRequest{});
  }
}

}  // namespace

std::string CheckBytes(const uint8_t* data, size_t size, Counts* counts) {
  ++counts->inputs;
  FrameParser host;
  Device device;
  for (size_t i = 0; i < size; ++i) {
    if (host.Push(data[i])) {
      ++counts->good_frames;
      if (!IsConsistent(host.payload(), host.size()))
        return "a message encodes to other bytes than it came from";
    }
    device.counter += data[i];
    device.effector.OnByte(data[i]);
    if (data[i] % 16 == 0) device.effector.OnEdge(data[i] >> 5, data[i] & 0x10, device.counter);
    device.effector.OnTime();
  }
  counts->damaged_frames += host.bad_frames();

  // What the device wrote can be read.
  FrameParser reader;
  for (uint8_t byte : device.written) {
    if (reader.Push(byte) && !IsConsistent(reader.payload(), reader.size()))
      return "the device wrote a wrong message";
  }
  return reader.bad_frames() == 0 ? "" : "the device wrote a wrong frame";
}

std::string CheckConversation(uint64_t seed, Counts* counts) {
  ++counts->inputs;
  Damage damage(seed), damage_to_host(~seed);  // each knows what went before in its direction
  Device device;
  device.counter = 1;
  Ear device_ear, host_ear;
  std::vector<Edge> edges;
  std::string wrong;

  const auto to_device = [&](Bytes bytes, bool damaged) {
    device_ear.Sent(bytes);
    if (damaged) damage.Apply(&bytes);
    if (!device_ear.Hear(bytes, counts, [](const Bytes&) {}))
      wrong = "the device accepted what was never sent";
    for (uint8_t byte : bytes) device.effector.OnByte(byte);
  };
  const auto to_host = [&] {
    Bytes bytes;
    bytes.swap(device.written);
    host_ear.Sent(bytes);
    damage_to_host.Apply(&bytes);
    const bool good = host_ear.Hear(bytes, counts, [&](const Bytes& payload) {
      Event event;
      if (!Decode(payload.data(), payload.size(), &event)) return;
      ++counts->events;
      const bool pressed = event.kind == EventKind::kContact;
      const bool happened = std::any_of(edges.begin(), edges.end(), [&](const Edge& edge) {
        return edge.finger == event.finger && edge.pressed == pressed && edge.ticks == event.ticks;
      });
      if (!happened || event.touch < 1 || event.touch > 4)
        wrong = "the host accepted a contact that never was";
    });
    if (!good) wrong = "the host accepted what was never sent";
  };

  // It begins well, so that there is something to lose.
  Configure configure;
  configure.fingers = kMaxFingers;
  to_device(Frame(configure), false);
  to_device(Frame(Arm{1}), false);
  bool pressed[kMaxFingers] = {};
  for (uint64_t step = 4 + damage.Draw(24); step > 0 && wrong.empty(); --step) {
    device.counter += static_cast<uint32_t>(1 + damage.Draw(60000));
    const int finger = static_cast<int>(damage.Draw(kMaxFingers));
    pressed[finger] = !pressed[finger];
    edges.push_back({finger, pressed[finger], device.counter});
    device.effector.OnEdge(finger, pressed[finger], device.counter);
    to_device(DrawRequest(&damage, static_cast<uint32_t>(step)), true);
    device.effector.OnTime();
    to_host();
  }
  return wrong;
}

}  // namespace touchstone::fuzz
