// The functions that any thread may call, and the thread's outermost loop.
#include "server/gateway/effector/serial_effector.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <utility>

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"

namespace touchstone::gateway::effector {
namespace {

constexpr std::chrono::milliseconds kGuardPeriod{10};

absl::Status CheckOptions(const EffectorOptions& options) {
  const auto wrong = [](const std::string& text) {
    return absl::InvalidArgumentError(absl::StrCat("end effector: ", text));
  };
  if (options.fingers.empty() || options.fingers.size() > static_cast<size_t>(firmware::kMaxFingers))
    return wrong(absl::StrCat(options.fingers.size(), " fingers; right is 1 to ", firmware::kMaxFingers));
  for (size_t i = 0; i < options.fingers.size(); ++i) {
    const EffectorFinger& finger = options.fingers[i];
    const std::string name = absl::StrCat("finger ", i + 1, ": ");
    if (!(finger.debounce_s >= 0 && finger.debounce_s * kMicrosecondsPerSecond <= firmware::kMaxDebounceUs))
      return wrong(absl::StrCat(name, "debounce_s is ", finger.debounce_s, "; right is 0 to ",
                                firmware::kMaxDebounceUs * kSecondsPerMicrosecond));
    if (finger.hysteresis < 0 || finger.threshold <= finger.hysteresis || finger.threshold > 65535)
      return wrong(absl::StrCat(name, "threshold ", finger.threshold, " and hysteresis ", finger.hysteresis,
                                "; right is 0 <= hysteresis < threshold <= 65535 counts"));
  }
  for (const auto& [name, value] :
       {std::pair<const char*, double>{"reply_timeout_s", options.reply_timeout_s},
        {"silence_s", options.silence_s},
        {"clock_query_s", options.clock_query_s},
        {"time_scale", options.time_scale}})
    if (!(value > 0 && std::isfinite(value)))
      return wrong(absl::StrCat(name, " is ", value, "; right is above 0"));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<firmware::Sensor> ParseSensor(const std::string& name, const std::string& where) {
  if (name == "optical") return firmware::Sensor::kOptical;
  if (name == "microswitch") return firmware::Sensor::kMicroswitch;
  if (name == "resistor") return firmware::Sensor::kResistor;
  return absl::InvalidArgumentError(absl::StrCat(where, ": unknown sensor '", name, "'",
                                                 DidYouMean(name, {"optical", "microswitch", "resistor"})));
}

absl::StatusOr<std::unique_ptr<Effector>> Effector::Open(EffectorOptions options,
                                                         timing::ChangeNotifier* changes) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckOptions(options));
  auto effector = std::make_unique<SerialEffector>(std::move(options), changes);
  TOUCHSTONE_RETURN_IF_ERROR(effector->Start());
  return effector;
}

SerialEffector::SerialEffector(EffectorOptions options, timing::ChangeNotifier* changes)
    : options_(std::move(options)), changes_(changes), sync_(options_.time_scale) {
  state_.why = "not yet connected";
  state_.pressed.resize(options_.fingers.size());
}

SerialEffector::~SerialEffector() {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  Wake();
  if (thread_.joinable()) thread_.join();
  if (wake_fd_ >= 0) close(wake_fd_);
}

absl::Status SerialEffector::Start() {
  // A port that is missing is an error at once: a person has to fix it first.
  TOUCHSTONE_ASSIGN_OR_RETURN(port_, SerialPort::Open(options_.port, options_.baud));
  wake_fd_ = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  if (wake_fd_ < 0) return absl::ResourceExhaustedError("end effector: no more file descriptors");
  // Nonces differ between processes, so that an old reply is not taken for a new one.
  next_nonce_ = static_cast<uint32_t>(std::fmod(timing::HostNowS() * kMicrosecondsPerSecond, 4294967291.0));
  thread_ = std::thread([this] { Run(); });
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait(lock, [this] { return first_try_over_; });
  return absl::IsFailedPrecondition(first_try_) ? first_try_ : absl::OkStatus();
}

void SerialEffector::Run() {
  double backoff_s = 0.05;
  while (!Stopping()) {
    absl::Status status;
    if (port_.fd() < 0) {
      absl::StatusOr<SerialPort> port = SerialPort::Open(options_.port, options_.baud);
      if (port.ok()) port_ = *std::move(port);
      status = port.status();
    }
    if (status.ok()) status = RunSession();
    if (handshake_done_) backoff_s = 0.05;
    handshake_done_ = false;
    port_.Close();
    unsent_.clear();
    queries_.clear();
    damaged_ += parser_.bad_frames();
    parser_ = firmware::FrameParser();
    SetDisconnected(std::string(status.message()));
    {
      std::lock_guard<std::mutex> lock(mutex_);
      if (!first_try_over_) first_try_ = status;
      first_try_over_ = true;
    }
    changed_.notify_all();
    WaitAwake(backoff_s);
    backoff_s = std::min(1.0, 2 * backoff_s);
  }
}

void SerialEffector::SetDisconnected(const std::string& why) {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    state_.connected = false;
    state_.why = why;
    if (work_ != nullptr && !work_done_) {
      work_done_ = true;
      work_status_ = absl::UnavailableError(absl::StrCat("end effector: the line was lost: ", why));
    }
  }
  changed_.notify_all();
  if (changes_ != nullptr) changes_->Notify();
}

bool SerialEffector::Stopping() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return stopping_;
}

void SerialEffector::Wake() {
  const uint64_t one = 1;
  if (wake_fd_ >= 0 && write(wake_fd_, &one, sizeof one) < 0 && errno != EAGAIN) return;
}

void SerialEffector::WaitAwake(double seconds) {
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait_for(lock, std::chrono::duration<double>(seconds), [this] { return stopping_; });
}

absl::Status SerialEffector::Request(std::function<absl::Status()> work,
                                     const std::function<absl::Status()>& guard) {
  std::lock_guard<std::mutex> one(request_mutex_);
  std::unique_lock<std::mutex> lock(mutex_);
  const auto wait_for_work = [&]() -> absl::Status {
    const auto over = [this] { return work_ == nullptr || work_done_; };
    if (guard == nullptr) changed_.wait(lock, over);
    while (!changed_.wait_for(lock, kGuardPeriod, over)) {
      lock.unlock();  // the guard looks at other parts
      const absl::Status allowed = guard();
      lock.lock();
      TOUCHSTONE_RETURN_IF_ERROR(allowed);
    }
    return absl::OkStatus();
  };
  TOUCHSTONE_RETURN_IF_ERROR(wait_for_work());  // of a request that its guard has ended
  if (!state_.connected)
    return absl::UnavailableError(absl::StrCat("end effector: no connection: ", state_.why));
  work_ = std::move(work);
  work_done_ = false;
  Wake();
  TOUCHSTONE_RETURN_IF_ERROR(wait_for_work());
  work_ = nullptr;
  return work_status_;
}

absl::Status SerialEffector::StartCapture(uint32_t touch, const std::function<absl::Status()>& guard) {
  if (touch == firmware::kNoTouch)
    return absl::InvalidArgumentError("end effector: a touch's id is 0; right is above 0");
  return Request([this, touch] { return StartCaptureOnDevice(touch); }, guard);
}

absl::Status SerialEffector::EndCapture() {
  return Request([this] { return EndCaptureOnDevice(); });
}

absl::StatusOr<EffectorTouch> SerialEffector::Recall(uint32_t touch) {
  EffectorTouch recalled;
  TOUCHSTONE_RETURN_IF_ERROR(Request([this, touch, &recalled] {
    absl::StatusOr<EffectorTouch> record = RecallTouch(touch);
    if (record.ok()) recalled = *std::move(record);
    return record.status();
  }));
  return recalled;
}

absl::StatusOr<EffectorTouch> SerialEffector::Touch() const {
  std::lock_guard<std::mutex> lock(mutex_);
  if (record_.touch().touch == 0)
    return absl::FailedPreconditionError("end effector: no touch was armed yet");
  if (record_.Final()) return record_.touch();
  if (!record_.lost().empty()) return absl::UnavailableError(absl::StrCat("end effector: ", record_.lost()));
  if (!state_.connected)
    return absl::UnavailableError(absl::StrCat("end effector: the line was lost during touch ",
                                               record_.touch().touch, ": ", state_.why));
  return record_.touch();
}

EffectorState SerialEffector::State() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return state_;
}

timing::ClockEstimate SerialEffector::Clock() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return clock_;
}

}  // namespace touchstone::gateway::effector
