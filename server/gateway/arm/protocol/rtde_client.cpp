#include "server/gateway/arm/protocol/rtde_client.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <algorithm>

#include "server/base/status.h"
#include "server/gateway/arm/protocol/big_endian.h"

namespace touchstone::gateway::arm {
namespace {

// Host seconds.
constexpr double kReplyS = 1, kSendS = 0.01;
constexpr double kSliceS = 0.05;  // how soon a waiting thread notices that it shall end
constexpr int kMessagesBeforeReply = 2000;

}  // namespace

RtdeClient::RtdeClient(RtdeOptions options, std::function<void(const RtdeSample&, double)> on_sample,
                       std::function<void()> on_link)
    : options_(std::move(options)),
      on_sample_(std::move(on_sample)),
      on_link_(std::move(on_link)),
      link_(absl::UnavailableError(absl::StrCat("not connected to the controller at ", options_.address, ":",
                                                options_.port, " yet"))) {
  thread_ = std::thread([this] { Run(); });
}

RtdeClient::~RtdeClient() {
  ending_ = true;
  end_.Notify();
  thread_.join();
}

absl::Status RtdeClient::Link() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return link_;
}

std::string RtdeClient::ControllerVersion() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return version_;
}

void RtdeClient::SetLink(absl::Status status) {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    link_ = std::move(status);
  }
  on_link_();
}

void RtdeClient::Run() {
  double pause_s = kFirstPauseS;
  while (!ending_) {
    absl::StatusOr<std::unique_ptr<TcpSocket>> connected =
        TcpSocket::Connect(options_.address, options_.port, kConnectS);
    absl::Status status = connected.status();
    if (status.ok()) {
      const std::shared_ptr<TcpSocket> socket = *std::move(connected);
      framer_.Clear();
      status = Negotiate(socket.get());
      if (status.ok()) {
        {
          std::lock_guard<std::mutex> lock(write_mutex_);
          writer_ = socket;
        }
        pause_s = kFirstPauseS;
        SetLink(absl::OkStatus());
        status = Receive(socket.get());
        std::lock_guard<std::mutex> lock(write_mutex_);
        writer_.reset();
      }
    }
    if (ending_) return;
    SetLink(absl::Status(status.code() == absl::StatusCode::kFailedPrecondition
                             ? status.code()
                             : absl::StatusCode::kUnavailable,
                         absl::StrCat("the link to the controller at ", options_.address,
                                      " is down: ", status.message(), "; trying again")));
    const uint64_t seen = end_.count();
    if (!ending_) end_.WaitForChange(seen, pause_s);
    pause_s = std::min(2 * pause_s, kLongestPauseS);
  }
}

absl::StatusOr<std::string> RtdeClient::Ask(TcpSocket* socket, RtdeType type, const std::string& payload) {
  TOUCHSTONE_RETURN_IF_ERROR(socket->Send(EncodeRtde(type, payload), kReplyS));
  const double until_s = timing::HostNowS() + kReplyS;
  char buffer[4096];
  for (int seen = 0; seen < kMessagesBeforeReply;) {
    TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<RtdeMessage> message, framer_.Next());
    if (message.has_value()) {
      ++seen;
      if (message->type == static_cast<uint8_t>(type)) return std::move(message->payload);
      continue;  // texts, and data of an earlier recipe
    }
    const double left_s = until_s - timing::HostNowS();
    if (left_s <= 0 || ending_) break;
    TOUCHSTONE_ASSIGN_OR_RETURN(const size_t count,
                                socket->Receive(buffer, sizeof(buffer), std::min(left_s, kSliceS)));
    framer_.Append(absl::string_view(buffer, count));
  }
  return absl::UnavailableError(absl::StrCat("RTDE: no reply to '", std::string(1, static_cast<char>(type)),
                                             "' within ", kReplyS, " s"));
}

absl::Status RtdeClient::Negotiate(TcpSocket* socket) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string version_reply,
                              Ask(socket, RtdeType::kVersion, BigEndianWriter().U16(2).bytes()));
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool version_2, ParseAccepted(version_reply));
  if (!version_2)
    return absl::FailedPreconditionError(
        "RTDE: the controller does not know version 2; its software must be 3.4 or later");
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string about, Ask(socket, RtdeType::kControllerVersion, ""));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string version, ParseControllerVersion(about));

  // Old software does not tell the tool's offset: then its pose is taken as it comes.
  const auto outputs = [&]() -> absl::StatusOr<uint8_t> {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const std::string reply,
        Ask(socket, RtdeType::kOutputs,
            BigEndianWriter().F64(options_.rate_hz).Bytes(RtdeOutputNames(with_tcp_offset_)).bytes()));
    return ParseOutputRecipe(reply, with_tcp_offset_);
  };
  with_tcp_offset_ = true;
  absl::StatusOr<uint8_t> recipe = outputs();
  if (!recipe.ok() && absl::StrContains(recipe.status().message(), "tcp_offset")) {
    with_tcp_offset_ = false;
    recipe = outputs();
  }
  if (!recipe.ok())
    return absl::Status(recipe.status().code(),
                        absl::StrCat(recipe.status().message(), "; its software is ", version));
  output_recipe_ = *recipe;
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string input_reply,
                              Ask(socket, RtdeType::kInputs, RtdeInputNames()));
  TOUCHSTONE_ASSIGN_OR_RETURN(const uint8_t inputs, ParseInputRecipe(input_reply));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string start_reply, Ask(socket, RtdeType::kStart, ""));
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool started, ParseAccepted(start_reply));
  if (!started) return absl::UnavailableError("RTDE: the controller does not begin to send");
  {
    std::lock_guard<std::mutex> lock(mutex_);
    version_ = version;
  }
  std::lock_guard<std::mutex> lock(write_mutex_);
  input_recipe_ = inputs;
  return absl::OkStatus();
}

absl::Status RtdeClient::Receive(TcpSocket* socket) {
  double heard_s = timing::HostNowS();
  char buffer[16384];
  while (!ending_) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const size_t count, socket->Receive(buffer, sizeof(buffer), kSliceS));
    const double now_s = timing::HostNowS();
    if (count == 0) {
      if (now_s - heard_s > options_.silence_s)
        return absl::UnavailableError("it has been silent for too long");
      continue;
    }
    framer_.Append(absl::string_view(buffer, count));
    while (true) {
      TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<RtdeMessage> message, framer_.Next());
      if (!message.has_value()) break;
      if (message->type != static_cast<uint8_t>(RtdeType::kData)) continue;
      TOUCHSTONE_ASSIGN_OR_RETURN(const RtdeSample sample,
                                  ParseSample(message->payload, output_recipe_, with_tcp_offset_));
      heard_s = now_s;
      on_sample_(sample, now_s);
    }
  }
  return absl::OkStatus();
}

absl::Status RtdeClient::WriteInputs(int32_t heartbeat, int32_t command) {
  std::lock_guard<std::mutex> lock(write_mutex_);
  if (writer_ == nullptr) return Link();
  return writer_->Send(EncodeInputs(input_recipe_, heartbeat, command), kSendS);
}

}  // namespace touchstone::gateway::arm
