#include "client/source/connection.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <chrono>
#include <thread>

#include "client/source/tls_probe.h"
#include "server/base/status.h"
#include "server/service/host_port.h"

namespace touchstone::client {
namespace {

constexpr std::chrono::milliseconds kRetryInterval{100};

std::chrono::system_clock::time_point InSeconds(double seconds) {
  return std::chrono::system_clock::now() +
         std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::duration<double>(seconds));
}

// "host:port" with a port from 1 to 65535, or an address scheme of gRPC's own ("unix:/run/touchstone").
absl::Status ValidateAddress(const std::string& address) {
  if (address.rfind("unix:", 0) == 0 && address.size() > 5) return absl::OkStatus();
  const std::optional<service::HostPort> parsed = service::ParseHostPort(address);
  if (!parsed || parsed->host.empty() || parsed->port == 0)
    return absl::InvalidArgumentError(
        absl::StrCat("--server: '", address, "' is not HOST:PORT, for instance 127.0.0.1:50051"));
  return absl::OkStatus();
}

// What keeps strangers from a server's memory: here the user asks for the user's own files.
void RaiseLimits(service::Limits* limits) {
  constexpr int kLargest = 2047, kMany = 1 << 30;
  limits->max_request_mib = limits->max_upload_mib = limits->max_message_mib = kLargest;
  limits->max_request_elements = limits->max_request_numbers = kMany;
  limits->max_touches_per_request = 100'000;  // touches of one request are one session
  limits->max_model_kib = 1024;
  limits->max_model_nodes = 100'000;
  limits->max_model_objects = 100'000;
  limits->max_session_mib = 4095;
  limits->max_session_touches = limits->max_session_objects = kMany;
  limits->max_session_columns = 4096;
  limits->max_memory_mib = 1 << 30;
  limits->max_diagnoses_per_client = limits->max_diagnoses;
  limits->max_streams_per_client = limits->max_streams;
  limits->max_diagnosis_s = limits->stall_s = 1e6;
  limits->stream_memory_mib = 128;
  limits->max_unary_calls_per_s = 0;
  limits->max_unary_s = 1e6;
}

}  // namespace

absl::StatusOr<std::unique_ptr<Connection>> Connection::Open(ConnectionOptions options) {
  for (const std::string& server : options.servers) TOUCHSTONE_RETURN_IF_ERROR(ValidateAddress(server));
  std::unique_ptr<Connection> connection(new Connection);
  connection->options_ = std::move(options);
  if (connection->options_.servers.empty()) {
    service::ServerOptions embedded = connection->options_.embedded;
    embedded.listen.clear();
    RaiseLimits(&embedded);
    TOUCHSTONE_ASSIGN_OR_RETURN(connection->server_, service::Server::Start(std::move(embedded)));
    connection->address_ = "this process";
    connection->channel_ = connection->server_->InProcessChannel();
    connection->MakeStubs();
    return connection;
  }
  connection->server_index_ = connection->server_count() - 1;
  TOUCHSTONE_RETURN_IF_ERROR(connection->ConnectToOneThatStarts());
  return connection;
}

Connection::~Connection() {
  // The server drains when it goes; no call may be left on the channel by then.
  source_.reset();
  models_.reset();
  control_.reset();
  sessions_.reset();
  diagnosis_.reset();
  rig_.reset();
  channel_.reset();
}

absl::Status Connection::ConnectToOneThatStarts() {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(options_.wait_s);
  for (bool waiting = false;; waiting = true) {
    const absl::Status status = ConnectToNext();
    if (!absl::IsUnavailable(status) || std::chrono::steady_clock::now() + kRetryInterval > end)
      return status;
    if (!waiting && options_.on_wait)
      options_.on_wait(absl::StrCat("waiting for ", absl::StrJoin(options_.servers, " or "),
                                    " to answer, up to ", options_.wait_s, " s"));
    std::this_thread::sleep_for(kRetryInterval);
  }
}

absl::Status Connection::ConnectToNext() {
  if (embedded()) return absl::FailedPreconditionError("a source in this process cannot be lost");
  std::string tried;
  bool fits = true;  // what we show, as far as anybody answers
  for (int i = 1; i <= server_count(); ++i) {
    const int index = (server_index_ + i) % server_count();
    const absl::Status status = Connect(index);
    if (status.ok()) return status;
    fits = fits && !absl::IsInvalidArgument(status);
    absl::StrAppend(&tried, tried.empty() ? "" : "; ", status.message());
  }
  if (!fits) return absl::InvalidArgumentError(tried);
  return absl::UnavailableError(absl::StrCat(tried,
                                             ". Is touchstone-server running there, or touchstone-gateway if "
                                             "it is a rig's? A simulation needs neither: "
                                             "without --server it runs in this process"));
}

absl::Status Connection::Connect(int server_index) {
  const std::string& address = options_.servers[server_index];
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kMaxMessageBytes);
  arguments.SetMaxSendMessageSize(kMaxMessageBytes);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 1000);
  // A server whose machine died sends nothing: ask for a sign of life, so that a stream does not
  // wait for ever.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 20000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10000);
  // A name may stand for many equal servers: every call goes to the next one of its addresses that answers.
  if (absl::StartsWith(address, "dns:")) arguments.SetLoadBalancingPolicyName("round_robin");
  TOUCHSTONE_ASSIGN_OR_RETURN(auto channel, MakeChannel(address, options_.credentials, arguments));
  const auto failed = [&](const std::string& how) {
    const std::string why = ExplainTlsFailure(address, options_.credentials);
    return why.empty() ? absl::UnavailableError(how) : absl::InvalidArgumentError(why);
  };
  // Refused at once is an answer too: the next server should not wait for the whole time-out.
  const auto deadline = InSeconds(options_.connect_timeout_s);
  for (grpc_connectivity_state state; (state = channel->GetState(true)) != GRPC_CHANNEL_READY;) {
    if (state == GRPC_CHANNEL_TRANSIENT_FAILURE) return failed(absl::StrCat("no connection to ", address));
    if (!channel->WaitForStateChange(state, deadline))
      return failed(absl::StrCat("no answer from ", address, " within ", options_.connect_timeout_s, " s"));
  }
  server_index_ = server_index;
  address_ = address;
  channel_ = std::move(channel);
  MakeStubs();
  return absl::OkStatus();
}

void Connection::MakeStubs() {
  source_ = v1::Source::NewStub(channel_);
  models_ = v1::Models::NewStub(channel_);
  control_ = v1::Control::NewStub(channel_);
  sessions_ = v1::Sessions::NewStub(channel_);
  diagnosis_ = v1::Diagnosis::NewStub(channel_);
  rig_ = v1::Rig::NewStub(channel_);
}

}  // namespace touchstone::client
