// The end effector at a serial port. One thread talks with the device; the others hand it a request and wait.
//
// After the line was lost the port is opened again. If the device still captures the current touch, the session
// resumes and the device's record supplies the events that were missed; otherwise Hello starts a new session.
#pragma once

#include <poll.h>

#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "firmware/core/frame.h"
#include "firmware/core/messages.h"
#include "server/gateway/effector/contact_record.h"
#include "server/gateway/effector/effector.h"
#include "server/gateway/effector/serial_port.h"

namespace touchstone::gateway::effector {

class SerialEffector : public Effector {
 public:
  SerialEffector(EffectorOptions options, timing::ChangeNotifier* changes);
  ~SerialEffector() override;
  // Starts the thread and waits for the first session to begin or fail.
  absl::Status Start();

  absl::Status StartCapture(uint32_t touch, const std::function<absl::Status()>& guard) override;
  absl::Status EndCapture() override;
  absl::StatusOr<EffectorTouch> Touch() const override;
  absl::StatusOr<EffectorTouch> Recall(uint32_t touch) override;
  EffectorState State() const override;
  timing::ClockEstimate Clock() const override;

 private:
  // What a message is to the request that waits: no reply to it, the reply, or its refusal.
  enum class Reply { kNo, kYes, kRefused };
  using ReplyMatcher = std::function<Reply(const uint8_t* payload, size_t size)>;

  // The thread.
  void Run();

  // handshake.cpp
  absl::Status Handshake();       // Resume or ExchangeHello; then the device is ready
  absl::StatusOr<bool> Resume();  // whether the device still captures the current touch
  absl::Status ExchangeHello();

  // session.cpp
  absl::Status RunSession();      // until the line is lost
  absl::Status ReconcileTouch();  // reads the device's record of the current touch until two readings agree
  absl::Status StartCaptureOnDevice(uint32_t touch);
  absl::Status EndCaptureOnDevice();
  // Asks until no finger is pressed, or kReleaseS is over; the mask of those that are.
  absl::StatusOr<uint32_t> AwaitRelease();
  absl::StatusOr<EffectorTouch> RecallTouch(uint32_t touch);
  absl::Status ReadRecord(uint32_t touch, const std::function<bool(const firmware::Recalled&)>& take);

  // message_loop.cpp Sends until `matcher` accepts a reply. DEADLINE_EXCEEDED: none after kTries;
  // FAILED_PRECONDITION: refused; else the line's error.
  template <typename Message>
  absl::Status Ask(const Message& message, const ReplyMatcher& matcher) {
    uint8_t payload[firmware::kMaxPayload];
    const size_t size = firmware::Encode(message, payload);
    return AskPayload(payload, size, matcher);
  }
  template <typename Message>
  absl::Status Send(const Message& message) {
    uint8_t payload[firmware::kMaxPayload];
    const size_t size = firmware::Encode(message, payload);
    return SendPayload(payload, size);
  }
  absl::Status AskPayload(const uint8_t* payload, size_t payload_size, const ReplyMatcher& matcher);
  absl::Status SendPayload(const uint8_t* payload, size_t size);
  absl::Status Flush();
  // Reads, handles and keeps time until then or until `done` (asked after each message).
  absl::Status Pump(double until_host_s, const std::function<bool()>& done);
  absl::Status ReadAll();
  void Handle(const uint8_t* payload, size_t size, double host_s);
  void HandleEvent(const firmware::Event& event);
  void HandleClock(const firmware::ClockReply& reply, size_t payload_size, double host_s);
  void HandleStatus(const firmware::Status& status);
  void QueryClock();
  void SetDisconnected(const std::string& why);
  uint64_t MaxTicks() const;  // kClockSlackS later than now, device clock; 0 while the clock is unknown

  // serial_effector.cpp
  bool Stopping() const;
  void Wake();
  void WaitAwake(double seconds);

  // The other threads.
  // `work` is what the thread does, and may outlive this call if the guard ends it.
  absl::Status Request(std::function<absl::Status()> work,
                       const std::function<absl::Status()>& guard = nullptr);

  static constexpr int kTries = 60;          // of a request
  static constexpr double kClockSlackS = 1;  // by which a device time may seem wrong, in host seconds

  const EffectorOptions options_;
  timing::ChangeNotifier* const changes_;
  int wake_fd_ = -1;
  std::thread thread_;

  // Of the thread alone.
  SerialPort port_;
  firmware::FrameParser parser_;
  std::vector<uint8_t> unsent_;
  timing::ClockSync sync_;
  ReplyMatcher matcher_;
  Reply reply_ = Reply::kNo;
  firmware::Refused refused_;
  std::map<uint32_t, double> queries_;  // sent at, host
  uint32_t next_query_ = 1, next_nonce_ = 1;
  double query_at_s_ = 0, heard_at_s_ = 0;
  bool handshake_done_ = false;
  int unexpected_statuses_ = 0;  // in succession
  std::string session_error_;    // ends the session; empty: none
  firmware::Event stale_event_;
  uint64_t damaged_ = 0;  // frames, but for those that parser_ counts

  std::mutex request_mutex_;  // one request at a time
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  bool stopping_ = false;
  bool first_try_over_ = false;
  absl::Status first_try_;
  std::function<absl::Status()> work_;
  bool work_done_ = false;
  absl::Status work_status_;
  EffectorState state_;
  timing::ClockEstimate clock_;
  ContactRecord record_;
};

}  // namespace touchstone::gateway::effector
