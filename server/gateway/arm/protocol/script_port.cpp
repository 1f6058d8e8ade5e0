#include "server/gateway/arm/protocol/script_port.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <chrono>

#include "server/base/status.h"

namespace touchstone::gateway::arm {
namespace {

// Host seconds.
constexpr double kScriptSendS = 0.05, kScriptSliceS = 0.1;

}  // namespace

ScriptPort::ScriptPort(std::string address, int port, std::function<void(const PrimaryUpdate&)> on_update)
    : address_(std::move(address)), port_(port), on_update_(std::move(on_update)) {
  thread_ = std::thread([this] { Run(); });
}

ScriptPort::~ScriptPort() {
  ending_ = true;
  end_.Notify();
  thread_.join();
}

bool ScriptPort::Connected() const {
  std::lock_guard<std::timed_mutex> lock(mutex_);
  return writer_ != nullptr;
}

absl::Status ScriptPort::SendLocked(const std::string& program) {
  if (writer_ == nullptr)
    return absl::UnavailableError(
        absl::StrCat("no connection to the controller's interface at ", address_, ":", port_));
  const absl::Status sent = writer_->Send(program, kScriptSendS);
  if (!sent.ok()) writer_.reset();  // half a program may have gone out; the receiving thread connects anew
  return sent;
}

absl::Status ScriptPort::Send(const std::string& program, const std::function<std::string()>& after) {
  std::lock_guard<std::timed_mutex> lock(mutex_);
  TOUCHSTONE_RETURN_IF_ERROR(SendLocked(program));
  const std::string more = after == nullptr ? "" : after();
  return more.empty() ? absl::OkStatus() : SendLocked(more);
}

absl::Status ScriptPort::TrySend(const std::string& program) {
  std::unique_lock<std::timed_mutex> lock(mutex_, std::chrono::milliseconds(15));
  if (!lock.owns_lock()) return absl::UnavailableError("another program is just being sent");
  return SendLocked(program);
}

void ScriptPort::Run() {
  double pause_s = kFirstPauseS;
  while (!ending_) {
    absl::StatusOr<std::unique_ptr<TcpSocket>> connected = TcpSocket::Connect(address_, port_, kConnectS);
    if (connected.ok()) {
      const std::shared_ptr<TcpSocket> socket = *std::move(connected);
      pause_s = kFirstPauseS;
      {
        std::lock_guard<std::timed_mutex> lock(mutex_);
        writer_ = socket;
      }
      Receive(socket.get()).IgnoreError();  // whatever it was, the answer is to connect again
      std::lock_guard<std::timed_mutex> lock(mutex_);
      writer_.reset();
    }
    const uint64_t seen = end_.count();
    if (!ending_) end_.WaitForChange(seen, pause_s);
    pause_s = std::min(2 * pause_s, kLongestPauseS);
  }
}

absl::Status ScriptPort::Receive(TcpSocket* socket) {
  PrimaryStream stream;
  char buffer[8192];
  while (!ending_) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const size_t count, socket->Receive(buffer, sizeof(buffer), kScriptSliceS));
    stream.Append(absl::string_view(buffer, count));
    while (true) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<PrimaryUpdate> update, stream.Next());
      if (!update.has_value()) break;
      if (on_update_ != nullptr) on_update_(*update);
    }
    if (!Connected()) return absl::UnavailableError("a program could not be sent");
  }
  return absl::OkStatus();
}

}  // namespace touchstone::gateway::arm
