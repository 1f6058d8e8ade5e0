#include "server/service/server.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/health_check_service_interface.h>
#include <spdlog/spdlog.h>

#include "grpc/health/v1/health.pb.h"
#include "server/base/status.h"
#include "server/base/text.h"
#include "server/effects/all_effects.h"
#include "server/service/control_service.h"
#include "server/service/diagnosis_service.h"
#include "server/service/models_service.h"
#include "server/service/resources.h"
#include "server/service/sessions_service.h"
#include "server/service/source_service.h"

namespace touchstone {
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

absl::Status CheckRange(int value, int lower, int upper, const char* name) {
  if (value >= lower && value <= upper) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(name, " = ", value, ": must be from ", lower, " to ", upper));
}

absl::Status CheckOptions(const ServerOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(options.threads, 0, 1024, "threads"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(options.most_batch_size, 1, 1 << 20, "most_batch_size"));
  TOUCHSTONE_RETURN_IF_ERROR(
      CheckRange(options.most_touches_per_request, 1, 10'000'000, "most_touches_per_request"));
  TOUCHSTONE_RETURN_IF_ERROR(
      CheckRange(options.most_images_per_request, 1, 1'000'000, "most_images_per_request"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(options.most_streams, 1, 100'000, "most_streams"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(options.most_message_mib, 1, 2047, "most_message_mib"));
  // A session goes through a receive buffer and the reader's line numbers, which are ints.
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(options.most_session_mib, 1, 4095, "most_session_mib"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(options.most_sessions_mib, 1, 1 << 30, "most_sessions_mib"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(options.most_diagnoses, 1, 1000, "most_diagnoses"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(options.most_proposed_touches, 1, 100'000, "most_proposed_touches"));
  TOUCHSTONE_RETURN_IF_ERROR(
      CheckRange(options.supershape_triangles, 100, 4'000'000, "supershape_triangles"));
  for (const auto& [value, name] :
       {std::pair(options.lease_window_s, "lease_window_s"), std::pair(options.drain_s, "drain_s")})
    if (!(value >= 0.01 && value <= 3600))
      return absl::InvalidArgumentError(
          absl::StrCat(name, " = ", ShortestNumber(value), ": must be from 0.01 to 3600 seconds"));
  return absl::OkStatus();
}

// A model by name, or the file of one.
absl::StatusOr<std::shared_ptr<const Model>> DefaultModel(const std::string& name, ModelStore* store) {
  if (!absl::EndsWith(name, ".yaml")) return store->FindByName(name);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(name, 1 << 20));
  TOUCHSTONE_ASSIGN_OR_RETURN(const Model model, ParseModel(text, name, Catalogue()));
  TOUCHSTONE_RETURN_IF_ERROR(store->Create(model));
  return store->FindByName(model.name);
}

}  // namespace

struct Server::Parts {
  Resources resources;
  std::unique_ptr<LeaseBook> leases;
  std::unique_ptr<SourceService> source;
  std::unique_ptr<ControlService> control;
  std::unique_ptr<ModelsService> models;
  std::unique_ptr<SessionsService> sessions;
  std::unique_ptr<DiagnosisService> diagnosis;
  std::unique_ptr<grpc::Server> server;
  int port = 0;
};

Server::Server() : parts_(std::make_unique<Parts>()) {}

absl::StatusOr<std::unique_ptr<Server>> Server::Start(ServerOptions options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckOptions(options));
  EnablePlugins();
  std::unique_ptr<Server> server(new Server);
  Parts& parts = *server->parts_;
  Resources& resources = parts.resources;
  resources.options = options;
  resources.pool = std::make_unique<ThreadPool>(options.threads);
  TOUCHSTONE_ASSIGN_OR_RETURN(resources.objects, ObjectStore::Load(options, resources.pool.get()));
  TOUCHSTONE_ASSIGN_OR_RETURN(resources.models, ModelStore::Open(options.models_dir));
  TOUCHSTONE_ASSIGN_OR_RETURN(resources.sessions, SessionStore::Open(options));
  TOUCHSTONE_ASSIGN_OR_RETURN(resources.default_model,
                              DefaultModel(options.default_model, resources.models.get()));
  parts.leases = std::make_unique<LeaseBook>(options.lease_window_s);
  parts.source = std::make_unique<SourceService>(&resources, parts.leases.get());
  parts.control = std::make_unique<ControlService>(&resources, parts.leases.get());
  parts.models = std::make_unique<ModelsService>(&resources);
  parts.sessions = std::make_unique<SessionsService>(&resources);
  parts.diagnosis = std::make_unique<DiagnosisService>(&resources);

  grpc::ServerBuilder builder;
  builder.SetMaxReceiveMessageSize(options.most_message_mib << 20);
  builder.SetMaxSendMessageSize(options.most_message_mib << 20);
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);  // a taken port is an error, not shared
  if (!options.listen.empty())
    builder.AddListeningPort(options.listen, grpc::InsecureServerCredentials(), &parts.port);
  builder.RegisterService(parts.source.get());
  builder.RegisterService(parts.control.get());
  builder.RegisterService(parts.models.get());
  builder.RegisterService(parts.sessions.get());
  builder.RegisterService(parts.diagnosis.get());
  parts.server = builder.BuildAndStart();
  if (parts.server == nullptr || (!options.listen.empty() && parts.port == 0)) {
    parts.server = nullptr;
    return absl::UnavailableError(absl::StrCat(
        "listen = '", options.listen,
        "': cannot listen there; is the address right (HOST:PORT, port 0 for any), and the port free?"));
  }
  if (auto* health = parts.server->GetHealthCheckService(); health != nullptr)
    for (const char* name : {"touchstone.v1.Source", "touchstone.v1.Control", "touchstone.v1.Models",
                             "touchstone.v1.Sessions", "touchstone.v1.Diagnosis"})
      health->SetServingStatus(name, true);
  return server;
}

Server::~Server() {
  if (parts_->server != nullptr) {
    parts_->server->Shutdown(std::chrono::system_clock::now());
    parts_->server->Wait();
  }
}

int Server::port() const {
  return parts_->port;
}

std::shared_ptr<grpc::Channel> Server::InProcessChannel() {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(parts_->resources.options.most_message_mib << 20);
  return parts_->server->InProcessChannel(arguments);
}

void Server::Drain() {
  parts_->resources.draining = true;
  if (auto* health = parts_->server->GetHealthCheckService(); health != nullptr)
    health->SetServingStatus(false);
  const auto limit = std::chrono::duration_cast<std::chrono::system_clock::duration>(
      std::chrono::duration<double>(parts_->resources.options.drain_s));
  parts_->server->Shutdown(std::chrono::system_clock::now() + limit);
  parts_->server->Wait();
}

}  // namespace touchstone
