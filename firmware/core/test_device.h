// A device for tests: the core with a simulated counter and a line that keeps what was sent. No heap: it also
// runs on the microcontroller.
#pragma once

#include <cstddef>
#include <cstdint>

#include "firmware/core/effector.h"

namespace touchstone::firmware {

class TestDevice {
 public:
  // The true time begins at `began`; the counter shows its lowest bits.
  explicit TestDevice(uint32_t tick_hz = 1000000, uint8_t tick_bits = 32, uint64_t began = 1000)
      : now_(began),
        tick_hz_(tick_hz),
        effector_(MakeIdentity(tick_hz, tick_bits), &OnWrite, &ReadNow, this) {
    effector_.OnTime();
    Drop();
  }

  uint64_t now() const { return now_; }
  Effector& effector() { return effector_; }

  // Lets the time pass, with OnTime every millisecond of it.
  void RunTo(uint64_t ticks) {
    const uint64_t step = tick_hz_ / 1000;
    while (now_ + step <= ticks) {
      now_ += step;
      effector_.OnTime();
    }
    now_ = ticks;
  }
  void RunMs(uint64_t ms) { RunTo(now_ + ms * (tick_hz_ / 1000)); }

  // An edge now, or one that was captured then and is handled only now.
  void Edge(int finger, bool level) { EdgeAt(finger, level, now_); }
  void EdgeAt(int finger, bool level, uint64_t ticks) {
    effector_.OnEdge(finger, level, static_cast<uint32_t>(ticks));
  }

  // From the host to the device.
  template <typename Message>
  void Send(const Message& message) {
    uint8_t payload[kMaxPayload];
    SendPayload(payload, Encode(message, payload));
  }
  void SendPayload(const uint8_t* payload, size_t size) {
    uint8_t frame[kMaxFrame];
    SendBytes(frame, EncodeFrame(payload, size, frame));
  }
  void SendBytes(const uint8_t* bytes, size_t size) {
    for (size_t i = 0; i < size; ++i) effector_.OnByte(bytes[i]);
  }

  // The oldest message of this type that was not taken yet; those of other types stay.
  template <typename Message>
  bool Take(Message* message) {
    for (size_t i = 0; i < sent_; ++i) {
      if (!Decode(payloads_[i].bytes, payloads_[i].size, message)) continue;
      for (size_t j = i + 1; j < sent_; ++j) payloads_[j - 1] = payloads_[j];
      --sent_;
      return true;
    }
    return false;
  }
  template <typename Message>
  int Count() {
    int count = 0;
    for (Message message; Take(&message);) ++count;
    return count;
  }
  void Drop() { sent_ = 0; }
  size_t sent() const { return sent_; }

  template <typename Request, typename Reply>
  bool Ask(const Request& request, Reply* reply) {
    Send(request);
    return Take(reply);
  }
  // Fingers of one kind.
  bool DoConfigure(int fingers, const FingerConfig& config) {
    Configure request;
    request.fingers = static_cast<uint8_t>(fingers);
    for (int i = 0; i < fingers; ++i) request.finger[i] = config;
    Configured reply;
    return Ask(request, &reply) && reply.fingers == fingers;
  }
  bool DoArm(uint32_t touch, Armed* armed = nullptr) {
    Arm request;
    request.touch = touch;
    Armed reply;
    const bool done = Ask(request, &reply) && reply.touch == touch;
    if (armed != nullptr) *armed = reply;
    return done;
  }
  void DoAcknowledge(uint32_t number) {
    Acknowledge request;
    request.number = number;
    Send(request);
  }

 private:
  struct Payload {
    size_t size = 0;
    uint8_t bytes[kMaxPayload] = {};
  };

  static Identity MakeIdentity(uint32_t tick_hz, uint8_t tick_bits) {
    Identity identity;
    identity.boot_id = 0xB007;
    identity.tick_hz = tick_hz;
    identity.tick_bits = tick_bits;
    identity.firmware = "test 1";
    return identity;
  }
  static void OnWrite(void* context, const uint8_t* frame, size_t size) {
    TestDevice* self = static_cast<TestDevice*>(context);
    for (size_t i = 0; i < size; ++i) {
      if (!self->line_.Push(frame[i]) || self->sent_ == kKept) continue;
      Payload& payload = self->payloads_[self->sent_++];
      payload.size = self->line_.size();
      for (size_t j = 0; j < payload.size; ++j) payload.bytes[j] = self->line_.payload()[j];
    }
  }
  static uint32_t ReadNow(void* context) {
    return static_cast<uint32_t>(static_cast<TestDevice*>(context)->now_);
  }

  static constexpr size_t kKept = 96;
  uint64_t now_;
  uint32_t tick_hz_;
  FrameParser line_;
  Payload payloads_[kKept];
  size_t sent_ = 0;
  Effector effector_;
};

}  // namespace touchstone::firmware
