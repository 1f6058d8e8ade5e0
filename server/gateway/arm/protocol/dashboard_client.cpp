#include "server/gateway/arm/protocol/dashboard_client.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/gateway/timing/change_notifier.h"

namespace touchstone::gateway::arm {
namespace {

constexpr size_t kLongestLine = 4096;

}  // namespace

absl::StatusOr<std::string> DashboardClient::ReadLine(double until_host_s) {
  while (true) {
    if (const size_t end = unread_.find('\n'); end != std::string::npos) {
      std::string line = unread_.substr(0, end);
      unread_.erase(0, end + 1);
      return std::string(absl::StripAsciiWhitespace(line));
    }
    if (unread_.size() > kLongestLine) return absl::DataLossError("dashboard: a line without an end");
    const double left_s = until_host_s - timing::HostNowS();
    if (left_s <= 0) return absl::UnavailableError("dashboard: no reply in time");
    char buffer[1024];
    TOUCHSTONE_ASSIGN_OR_RETURN(const size_t count, socket_->Receive(buffer, sizeof(buffer), left_s));
    unread_.append(buffer, count);
  }
}

absl::StatusOr<std::string> DashboardClient::Ask(const std::string& command, double timeout_s,
                                                 const SendGate& gate) {
  std::lock_guard<std::mutex> lock(mutex_);
  const double until_s = timing::HostNowS() + timeout_s;
  // A connection that has lain idle may be gone: one more try with a new one.
  absl::Status refused;  // by the gate
  for (int attempt = 0;; ++attempt) {
    const bool fresh = socket_ == nullptr;
    const absl::StatusOr<std::string> reply = [&]() -> absl::StatusOr<std::string> {
      if (fresh) {
        TOUCHSTONE_ASSIGN_OR_RETURN(socket_, TcpSocket::Connect(address_, port_, timeout_s));
        unread_.clear();
        TOUCHSTONE_ASSIGN_OR_RETURN(const std::string banner, ReadLine(until_s));
        if (!absl::StartsWith(banner, "Connected"))
          return absl::UnavailableError(absl::StrCat("dashboard: greets with '", banner.substr(0, 80), "'"));
      }
      bool asked = false;
      const auto send = [&] {
        asked = true;
        return socket_->Send(command + "\n", timeout_s);
      };
      const absl::Status sent = gate == nullptr ? send() : gate(send);
      if (!asked) refused = sent;
      TOUCHSTONE_RETURN_IF_ERROR(sent);
      return ReadLine(until_s);
    }();
    // In local control an e-Series controller refuses, and goes on refusing on this connection after it was switched to
    // remote control ("... and reconnect to port 29999").
    if (reply.ok() && absl::StrContains(*reply, "reconnect to port")) socket_.reset();
    if (reply.ok()) return reply;
    if (!refused.ok()) return refused;
    socket_.reset();  // a late reply must not be taken for that of the next command
    if (fresh || attempt > 0 || timing::HostNowS() >= until_s)
      return absl::UnavailableError(absl::StrCat("'", command, "': ", reply.status().message()));
  }
}

absl::Status DashboardClient::Demand(const std::string& command, const std::string& expected,
                                     double timeout_s, const SendGate& gate) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string reply, Ask(command, timeout_s, gate));
  if (absl::StartsWith(reply, expected)) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("the controller answers '", command, "' with '", reply.substr(0, 200), "'"));
}

}  // namespace touchstone::gateway::arm
