#include "server/service/serving.h"

#include <absl/strings/str_cat.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>

#include <algorithm>

#include "grpc/health/v1/health.pb.h"
#include "server/base/status.h"
#include "server/service/option_table.h"

namespace touchstone::service {
namespace {

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

void SetLimits(const ServerOptions& options, grpc::ServerBuilder* builder) {
  // The largest that some method takes; the others are told by their own limit (request_guard.h).
  builder->SetMaxReceiveMessageSize(std::max(options.max_request_mib, options.max_upload_mib) << 20);
  builder->SetMaxSendMessageSize(options.max_message_mib << 20);
  // gRPC would unpack a message of any size before it looks at the size.
  builder->SetCompressionAlgorithmSupportStatus(GRPC_COMPRESS_GZIP, false);
  builder->SetCompressionAlgorithmSupportStatus(GRPC_COMPRESS_DEFLATE, false);
}

}  // namespace

absl::Status CheckServing(const ServerOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckLimits(options));
  TOUCHSTONE_RETURN_IF_ERROR(
      CheckRange(options.supershape_triangles, 100, 4'000'000, "supershape_triangles"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(options.lease_window_s, 0.01, 3600, "lease_window_s"));
  return absl::OkStatus();
}

absl::StatusOr<Serving> StartServing(const ServerOptions& options, const std::vector<ServedService>& services,
                                     Access* access) {
  for (const ServedService& service : services) TOUCHSTONE_RETURN_IF_ERROR(CheckRolesOf(service.name));
  EnablePlugins();
  Serving serving;
  grpc::ServerBuilder builder;
  SetLimits(options, &builder);
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);  // a taken port is an error, not shared
  if (!options.listen.empty()) builder.AddListeningPort(options.listen, access->Credentials(), &serving.port);
  for (const ServedService& service : services) builder.RegisterService(service.service);
  serving.server = builder.BuildAndStart();
  if (serving.server == nullptr || (!options.listen.empty() && serving.port == 0))
    return absl::UnavailableError(absl::StrCat(
        "listen = '", options.listen,
        "': cannot listen there; is the address right (HOST:PORT, port 0 for any), and the port free?"));
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
