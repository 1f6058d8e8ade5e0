#include "server/service/rpc/serving.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <limits>

#include "grpc/health/v1/health.pb.h"
#include "server/base/status.h"
#include "server/service/core/call_log.h"
#include "server/service/options/option_table.h"

namespace touchstone::service {
namespace {

// A stop of a rig ends when the arm stands; others may stop it meanwhile.
constexpr int kStopThreads = 4, kControlThreads = 2;

// Health checking and reflection are process-wide switches of gRPC.
void EnablePlugins() {
  static const bool enabled = [] {
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    grpc::health::v1::HealthCheckRequest::descriptor();  // links the description, so that reflection has it
    return true;
  }();
  (void)enabled;
}

int Milliseconds(double seconds) {
  return static_cast<int>(std::min(1e3 * seconds, static_cast<double>(std::numeric_limits<int>::max())));
}

void SetLimits(const ServerOptions& options, grpc::ServerBuilder* builder) {
  // The largest that some method takes; the others are told by their own limit (request_guard.h).
  builder->SetMaxReceiveMessageSize(std::max(options.max_request_mib, options.max_upload_mib) << 20);
  builder->SetMaxSendMessageSize(options.max_message_mib << 20);
  // gRPC would unpack a message of any size before it looks at the size.
  builder->SetCompressionAlgorithmSupportStatus(GRPC_COMPRESS_GZIP, false);
  builder->SetCompressionAlgorithmSupportStatus(GRPC_COMPRESS_DEFLATE, false);
  grpc::ResourceQuota quota("touchstone");
  quota.SetMaxThreads(options.max_threads);
  builder->SetResourceQuota(quota);
  builder->AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, options.max_streams_per_connection);
  builder->AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS, Milliseconds(options.handshake_s));
  builder->AddChannelArgument(GRPC_ARG_MAX_CONNECTION_IDLE_MS, Milliseconds(options.connection_idle_s));
  builder->AddChannelArgument(GRPC_ARG_MAX_CONNECTION_AGE_MS, Milliseconds(options.connection_age_s));
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, Milliseconds(options.keepalive_s));
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, Milliseconds(options.keepalive_timeout_s));
  // Clients ask for signs of life too, ours after every 2 s of silence (client/source/connection/retry.h); by itself gRPC takes more
  // than one in 5 min for an attack.
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 1'000);
}

}  // namespace

absl::Status CheckServing(const ServerOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckLimits(options));
  TOUCHSTONE_RETURN_IF_ERROR(
      CheckRange(options.supershape_triangles, 100, 4'000'000, "supershape_triangles"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(options.lease_window_s, 0.01, 3600, "lease_window_s"));
  return absl::OkStatus();
}

void Serving::End() {
  if (acceptor != nullptr) acceptor->End();
  if (server != nullptr) {
    server->Shutdown(std::chrono::system_clock::now());
    server->Wait();
  }
  queues.clear();
}

absl::StatusOr<Serving> StartServing(const ServerOptions& options, const std::vector<ServedService>& services,
                                     ControlService* control, Access* access, CallMetrics* calls) {
  for (const ServedService& service : services) TOUCHSTONE_RETURN_IF_ERROR(CheckRolesOf(service.name));
  EnablePlugins();
  Serving serving;
  grpc::ServerBuilder builder;
  SetLimits(options, &builder);
  std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> connections;
  const bool at_path = absl::StartsWith(options.listen, "unix:");  // no address to count connections by
  if (at_path) {
    builder.AddListeningPort(options.listen, access->Credentials(), &serving.port);
  } else if (!options.listen.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(serving.acceptor,
                                ConnectionAcceptor::Listen(options.listen, options, access->certificates()));
    serving.port = serving.acceptor->port();
    connections = builder.experimental().AddExternalConnectionAcceptor(
        grpc::ServerBuilder::experimental_type::ExternalConnectionType::FROM_FD, access->Credentials());
  }
  if (calls != nullptr || spdlog::should_log(spdlog::level::debug)) {
    std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> interceptors;
    interceptors.push_back(MakeCallInterceptors(calls));
    builder.experimental().SetInterceptorCreators(std::move(interceptors));
  }
  for (const ServedService& service : services) builder.RegisterService(service.service);
  serving.queues.push_back(std::make_unique<CallQueue>(&builder, kStopThreads, control->StopMethods()));
  serving.queues.push_back(std::make_unique<CallQueue>(&builder, kControlThreads, control->OtherMethods()));
  serving.server = builder.BuildAndStart();
  if (serving.server == nullptr || (at_path && serving.port == 0))
    return absl::UnavailableError(
        absl::StrCat("listen = '", options.listen, "': a server could not be started there"));
  for (const auto& queue : serving.queues) queue->Begin();
  if (connections != nullptr) serving.acceptor->Begin(std::move(connections));
  if (auto* health = serving.server->GetHealthCheckService(); health != nullptr)
    for (const ServedService& service : services) health->SetServingStatus(service.name, true);
  return serving;
}

void StopServing(const ServerOptions& options, grpc::Server* server) {
  if (auto* health = server->GetHealthCheckService(); health != nullptr) health->SetServingStatus(false);
  const auto limit = std::chrono::duration_cast<std::chrono::system_clock::duration>(
      std::chrono::duration<double>(options.drain_s));
  server->Shutdown(std::chrono::system_clock::now() + limit);
  server->Wait();
}

}  // namespace touchstone::service
