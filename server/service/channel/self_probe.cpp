#include "server/service/channel/self_probe.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <memory>

#include "grpc/health/v1/health.grpc.pb.h"
#include "server/service/channel/channel.h"

namespace touchstone::service {
namespace {

std::shared_ptr<grpc::ChannelCredentials> CredentialsFor(bool tls) {
  if (!tls) return grpc::InsecureChannelCredentials();
  grpc::experimental::TlsChannelCredentialsOptions options;
  options.set_verify_server_certs(false);
  options.set_check_call_host(false);
  return grpc::experimental::TlsCredentials(options);
}

}  // namespace

std::string OwnAddress(const std::string& listen, int port) {
  if (absl::StartsWith(listen, "unix:")) return listen;
  std::string host = listen.substr(0, listen.rfind(':'));
  if (host.empty() || host == "0.0.0.0" || host == "[::]") host = "127.0.0.1";
  return absl::StrCat(host, ":", port);
}

SelfProbe::SelfProbe(const std::string& address, bool tls, double every_s, double answer_s,
                     std::function<void()> on_deaf, int unanswered, const Clock& clock)
    : address_(address),
      tls_(tls),
      every_s_(every_s),
      answer_s_(answer_s),
      on_deaf_(std::move(on_deaf)),
      unanswered_(unanswered),
      clock_(clock) {
  thread_ = std::thread([this] { Run(); });
}

SelfProbe::~SelfProbe() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
    if (asking_ != nullptr) asking_->TryCancel();
  }
  wake_.notify_all();
  thread_.join();
}

void SelfProbe::Run() {
  for (int unanswered = 0; unanswered < unanswered_;) {
    {
      std::unique_lock<std::mutex> lock(mutex_);
      if (clock_.WaitFor(lock, wake_, every_s_, [this] { return stopping_; })) return;
    }
    unanswered = Answers() ? 0 : unanswered + 1;
    if (unanswered > 0)
      spdlog::warn("{} could not be reached by this process itself within {} s ({} of {})", address_,
                   answer_s_, unanswered, unanswered_);
  }
  on_deaf_();
}

bool SelfProbe::Answers() {
  // Without a file to spare nobody can connect, this process to itself neither.
  const int file = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (file < 0) return false;
  ::close(file);
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);  // a new connection
  // gRPC gives up connecting after this time, 20 s by itself, with the same error as if it had been refused.
  constexpr double kMaxMs = 2e9;
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS,
                   static_cast<int>(std::min(2e3 * answer_s_ + 1e3, kMaxMs)));
  const auto channel = OpenChannel(address_, CredentialsFor(tls_), arguments, {}, ProxyUse::kNever);
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() +
                       std::chrono::microseconds(static_cast<int64_t>(1e6 * answer_s_)));
  const auto ask = [&](grpc::ClientContext* question) {
    const std::lock_guard<std::mutex> lock(mutex_);
    asking_ = question;
    return !stopping_;
  };
  if (!ask(&context)) return true;
  grpc::health::v1::HealthCheckResponse response;
  const grpc::Status status = grpc::health::v1::Health::NewStub(channel)->Check(&context, {}, &response);
  ask(nullptr);
  return status.error_code() != grpc::StatusCode::DEADLINE_EXCEEDED;
}

}  // namespace touchstone::service
