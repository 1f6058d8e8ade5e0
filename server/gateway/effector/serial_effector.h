// The end effector at a serial port. One thread talks with the device; the others leave it a request and
// wait.
//
// After the line was lost the port is opened again. If the device is then still armed with the current touch,
// it goes on as if nothing had been, and its record tells what was missed. Otherwise Hello starts it anew.
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

namespace touchstone {

class SerialEffector : public Effector {
 public:
  SerialEffector(EffectorOptions options, ChangeNotifier* changes);
  ~SerialEffector() override;
  // Starts the thread and waits for the first conversation to begin or fail.
  absl::Status Start();

  absl::Status Arm(uint32_t touch) override;
  absl::Status Disarm() override;
  absl::StatusOr<EffectorTouch> Touch() const override;
  absl::StatusOr<EffectorTouch> Recall(uint32_t touch) override;
  EffectorState State() const override;
  ClockEstimate Clock() const override;

 private:
  // What a reply is to a request: not one, the answer, or why there will be none.
  enum class Answer { kNo, kYes, kRefused };
  using Judge = std::function<Answer(const uint8_t* payload, size_t size)>;

  // The thread.
  void Run();
  absl::Status Converse();        // until the line is lost
  absl::Status Greet();           // resume or Hello; then the device is ready
  absl::StatusOr<bool> Resume();  // whether the device is still armed with the current touch
  absl::Status SayHello();
  absl::Status SettleTouch();
  absl::Status ArmTouch(uint32_t touch);
  absl::Status DisarmTouch();
  absl::StatusOr<EffectorTouch> RecallTouch(uint32_t touch);
  absl::Status ReadRecord(uint32_t touch, const std::function<bool(const firmware::Recalled&)>& take);
  // Sends until `judge` says that it was answered. DEADLINE_EXCEEDED: no answer to 8 tries; else the line's
  // error.
  template <typename Message>
  absl::Status Ask(const Message& message, const Judge& judge);
  template <typename Message>
  absl::Status Send(const Message& message);
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
  uint64_t MaxTicks() const;  // a second later than now, device clock; 0 while the clock is unknown
  bool Stopping() const;
  void Wake();
  void WaitAwake(double seconds);

  // The other threads.
  absl::Status Request(std::function<absl::Status()> work);

  const EffectorOptions options_;
  ChangeNotifier* const changes_;
  int wake_fd_ = -1;
  std::thread thread_;

  // Of the thread alone.
  SerialPort port_;
  firmware::FrameParser parser_;
  std::vector<uint8_t> unsent_;
  ClockSync sync_;
  Judge judge_;
  Answer answer_ = Answer::kNo;
  firmware::Refused refused_;
  std::map<uint32_t, double> queries_;  // sent at, host
  uint32_t next_query_ = 1, next_nonce_ = 1;
  double query_at_s_ = 0, heard_at_s_ = 0;
  bool greeted_ = false;
  int strange_statuses_ = 0;  // in succession
  std::string strange_;
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
  ClockEstimate clock_;
  ContactRecord record_;
};

}  // namespace touchstone
