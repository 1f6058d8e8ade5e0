#include "client/source/connection/connection.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <chrono>

#include "client/source/connection/tls_probe.h"
#include "server/base/status.h"
#include "server/service/channel/channel.h"
#include "server/service/channel/host_port.h"

namespace touchstone::client {
namespace {

int Milliseconds(double seconds) {
  return static_cast<int>(1e3 * seconds);
}

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

// What keeps unauthenticated clients from a server's memory: here the user asks for the user's own files.
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
  Retry retry(server_count(), options_.wait_s, *options_.clock);
  for (bool waiting = false;; waiting = true) {
    const absl::Status status = ConnectToNext();
    if (!absl::IsUnavailable(status)) return status;
    const std::optional<double> pause_s = retry.PauseAfter(server_count());
    if (!pause_s) return status;
    if (!waiting && options_.log)
      options_.log(absl::StrCat("waiting for ", absl::StrJoin(options_.servers, " or "), " to answer, up to ",
                                options_.wait_s, " s"));
    options_.clock->SleepFor(*pause_s);
  }
}

absl::Status Connection::Retrying(const std::function<absl::Status()>& attempt, const RetryOptions& options) {
  return RetryingAfter(attempt(), attempt, options);
}

absl::Status Connection::RetryingAfter(absl::Status status, const std::function<absl::Status()>& attempt,
                                       const RetryOptions& options) {
  const auto worth_it = [&] { return IsLostServer(status) || IsFullServer(status); };
  if (embedded() || !worth_it()) return status;
  const Clock& clock = options.clock != nullptr ? *options.clock : *options_.clock;
  const auto& log = options.log ? options.log : options_.log;
  if (log) log(absl::StrCat("lost ", address_, ": ", status.message()));
  Retry retry(server_count(), options.retry_for_s.value_or(options_.retry_for_s), clock);
  int tried = 1;
  while (worth_it()) {
    const std::optional<double> pause_s = retry.PauseAfter(tried);
    if (!pause_s) return status;
    if (!options.wait)
      clock.SleepFor(*pause_s);
    else if (!options.wait(*pause_s))
      return absl::CancelledError("nobody waits for another server any more");
    status = ConnectToNext();
    tried = status.ok() ? 1 : server_count();
    if (status.ok()) status = attempt();
  }
  return status;
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
  // By its name this is the least time between two attempts; it is also how long an attempt may take, 20 s by itself. The first
  // one is ended below, just before.
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, Milliseconds(1.25 * options_.connect_timeout_s));
  // Otherwise a channel to the same address takes over the connection of the one before, with its pause of up to 1 s.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  // A server that was stopped, or whose machine died, sends nothing: it is asked for a sign of life during every call, also
  // where it computes for long and sends no data.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, Milliseconds(kKeepaliveS));
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, Milliseconds(kKeepaliveTimeoutS));
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  // A name may stand for many equal servers: every call goes to the next one of its addresses that answers.
  if (absl::StartsWith(address, "dns:")) arguments.SetLoadBalancingPolicyName("round_robin");
  TOUCHSTONE_ASSIGN_OR_RETURN(auto channel, MakeChannel(address, options_.credentials, arguments));
  const std::string proxy = service::ProxyFor(address);
  const auto unavailable = [&](const std::string& how) {
    return absl::UnavailableError(
        proxy.empty() ? how
                      : absl::StrCat(how, " through ", proxy, "; hosts in no_proxy are reached without it"));
  };
  const auto deadline = InSeconds(options_.connect_timeout_s);
  for (grpc_connectivity_state state; (state = channel->GetState(true)) != GRPC_CHANNEL_READY;) {
    // Refused at once is an answer too: the next server should not wait for the whole time-out.
    if (state == GRPC_CHANNEL_TRANSIENT_FAILURE) {
      // A TLS handshake of our own would go to the server itself, which only the proxy may reach.
      const std::string why = proxy.empty() ? ExplainTlsFailure(address, options_.credentials) : "";
      return why.empty() ? unavailable(absl::StrCat("no connection to ", address))
                         : absl::InvalidArgumentError(why);
    }
    if (!channel->WaitForStateChange(state, deadline))
      return unavailable(
          absl::StrCat("no answer from ", address, " within ", options_.connect_timeout_s, " s"));
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
