#include "server/service/rpc/server.h"

#include <absl/strings/match.h>
#include <grpcpp/grpcpp.h>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/effects/all_effects.h"
#include "server/service/calls/request_guard.h"
#include "server/service/core/resources.h"
#include "server/service/options/option_table.h"
#include "server/service/rpc/control_service.h"
#include "server/service/rpc/diagnosis_service.h"
#include "server/service/rpc/models_service.h"
#include "server/service/rpc/serving.h"
#include "server/service/rpc/sessions_service.h"
#include "server/service/rpc/source_service.h"
#include "server/service/rpc/status_pages.h"
#include "server/source/virtual_source.h"

namespace touchstone::service {
namespace {

absl::Status CheckOptions(const ServerOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckServing(options));
  TOUCHSTONE_RETURN_IF_ERROR(CheckRange(options.threads, 0, 1024, "threads"));
  return absl::OkStatus();
}

// A model by name, or the file of one.
absl::StatusOr<std::shared_ptr<const model::Model>> DefaultModel(const std::string& name, ModelStore* store) {
  if (!absl::EndsWith(name, ".yaml")) return store->FindByName(name);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(name, 1 << 20));
  TOUCHSTONE_ASSIGN_OR_RETURN(const model::Model model,
                              model::ParseModel(text, name, effects::Catalogue(), model::FilesBeside(name)));
  TOUCHSTONE_RETURN_IF_ERROR(store->Create(model));
  return store->FindByName(model.name);
}

}  // namespace

struct Server::Parts {
  Resources resources;
  std::unique_ptr<LeaseBook> leases;
  std::unique_ptr<source::Source> source;
  std::unique_ptr<SourceService> source_service;
  std::unique_ptr<ControlService> control;
  std::unique_ptr<ModelsService> models;
  std::unique_ptr<SessionsService> sessions;
  std::unique_ptr<DiagnosisService> diagnosis;
  Serving serving;
  std::unique_ptr<StatusPages> pages;  // asks the server
};

Server::Server() : parts_(std::make_unique<Parts>()) {}

absl::StatusOr<std::unique_ptr<Server>> Server::Start(ServerOptions options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckOptions(options));
  std::unique_ptr<Server> server(new Server);
  Parts& parts = *server->parts_;
  Resources& resources = parts.resources;
  resources.options = options;
  if (!options.metrics.empty()) resources.calls = std::make_unique<CallMetrics>();
  TOUCHSTONE_ASSIGN_OR_RETURN(
      resources.access, Access::Create(options.listen, options.access, Motion::kSimulated, *options.clock));
  resources.OpenPlaces();
  resources.access->CountRefusals(resources.calls.get());
  resources.pool = std::make_unique<ThreadPool>(options.threads);
  TOUCHSTONE_ASSIGN_OR_RETURN(
      resources.objects,
      source::ObjectStore::Load(options.meshes, options.supershape_triangles, resources.pool.get()));
  TOUCHSTONE_ASSIGN_OR_RETURN(resources.models, ModelStore::Open(options.models_dir));
  TOUCHSTONE_ASSIGN_OR_RETURN(resources.sessions, SessionStore::Open(options));
  TOUCHSTONE_ASSIGN_OR_RETURN(resources.default_model,
                              DefaultModel(options.default_model, resources.models.get()));
  parts.leases = std::make_unique<LeaseBook>(options.lease_window_s, false, *options.clock);
  parts.source =
      std::make_unique<source::VirtualSource>(&resources.objects, options.OfSource(), resources.default_model,
                                              options.renderer, resources.pool.get());
  parts.source_service = std::make_unique<SourceService>(&resources, parts.leases.get(), parts.source.get());
  parts.control = std::make_unique<ControlService>(&resources, parts.leases.get());
  parts.models = std::make_unique<ModelsService>(&resources);
  parts.sessions = std::make_unique<SessionsService>(&resources);
  parts.diagnosis = std::make_unique<DiagnosisService>(&resources);

  const std::vector<ServedService> services = {{"touchstone.v1.Source", parts.source_service.get()},
                                               {"touchstone.v1.Control", parts.control.get()},
                                               {"touchstone.v1.Models", parts.models.get()},
                                               {"touchstone.v1.Sessions", parts.sessions.get()},
                                               {"touchstone.v1.Diagnosis", parts.diagnosis.get()}};
  for (const ServedService& service : services)
    GuardRequests(service.service, &resources.options, resources.memory.get(), resources.rate.get());
  TOUCHSTONE_ASSIGN_OR_RETURN(Serving serving, StartServing(options, services, parts.control.get(),
                                                            resources.access.get(), resources.calls.get()));
  resources.memory->Begin();
  parts.serving = std::move(serving);
  if (!options.metrics.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(parts.pages, StatusPages::Start(options.metrics, &resources,
                                                                parts.serving.server->InProcessChannel({})));
  }
  return server;
}

Server::~Server() {
  parts_->pages.reset();
  parts_->serving.End();
}

int Server::metrics_port() const {
  return parts_->pages == nullptr ? 0 : parts_->pages->port();
}

int Server::port() const {
  return parts_->serving.port;
}

std::shared_ptr<grpc::Channel> Server::InProcessChannel() {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(parts_->resources.options.max_message_mib << 20);
  return parts_->serving.server->InProcessChannel(arguments);
}

void Server::Drain() {
  parts_->resources.draining = true;
  if (parts_->pages != nullptr) parts_->pages->StopAsking();
  if (parts_->serving.acceptor != nullptr) parts_->serving.acceptor->End();
  StopServing(parts_->resources.options, parts_->serving.server.get());
}

}  // namespace touchstone::service
