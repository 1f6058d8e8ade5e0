#include "server/service/models_service.h"

#include <spdlog/spdlog.h>

#include "server/effects/all_effects.h"
#include "server/service/convert.h"
#include "server/service/sent_model.h"

namespace touchstone::service {

grpc::Status ModelsService::ListEffects(grpc::ServerContext*, const v1::ListEffectsRequest*,
                                        v1::ListEffectsResponse* response) {
  for (const auto& effect : effects::Catalogue().All()) *response->add_effects() = ToProto(*effect);
  return grpc::Status::OK;
}

grpc::Status ModelsService::ListModels(grpc::ServerContext*, const v1::ListModelsRequest*,
                                       v1::ListModelsResponse* response) {
  for (const auto& model : resources_->models->All()) *response->add_models() = ToProto(*model);
  return grpc::Status::OK;
}

grpc::Status ModelsService::GetModel(grpc::ServerContext*, const v1::GetModelRequest* request,
                                     v1::Model* response) {
  const auto model = FromProto(request->model(), *resources_);
  if (!model.ok()) return ToGrpc(model.status());
  *response = ToProto(**model);
  return grpc::Status::OK;
}

grpc::Status ModelsService::CreateModel(grpc::ServerContext*, const v1::CreateModelRequest* request,
                                        v1::Model* response) {
  const auto model = ParseSentModel(request->yaml(), "yaml", resources_->options);
  if (!model.ok()) return ToGrpc(model.status());
  if (!request->validate_only()) {
    if (const absl::Status status = resources_->models->Create(*model); !status.ok()) return ToGrpc(status);
    spdlog::info("model '{}' added, hash {}", model->name, model->Hash().substr(0, 8));
  }
  *response = ToProto(*model);
  return grpc::Status::OK;
}

}  // namespace touchstone::service
