#include "server/service/rpc/models_service.h"

#include <spdlog/spdlog.h>

#include "server/effects/all_effects.h"
#include "server/service/calls/list_page.h"
#include "server/service/core/convert.h"
#include "server/service/core/sent_model.h"

namespace touchstone::service {

grpc::Status ModelsService::ListEffects(grpc::ServerContext*, const v1::ListEffectsRequest*,
                                        v1::ListEffectsResponse* response) {
  for (const auto& effect : effects::Catalogue().All()) *response->add_effects() = ToProto(*effect);
  return grpc::Status::OK;
}

grpc::Status ModelsService::ListModels(grpc::ServerContext*, const v1::ListModelsRequest* request,
                                       v1::ListModelsResponse* response) {
  const auto size = PageSize(request->page_size(), resources_->options.max_page_size);
  if (!size.ok()) return ToGrpc(size.status());
  const auto models = resources_->models->Behind(request->page_token());
  const auto add = [&](const std::shared_ptr<const model::Model>& model) {
    v1::Model* const message = response->add_models();
    *message = ToProto(*model);
    return message->ByteSizeLong();
  };
  FillPage(
      absl::MakeConstSpan(models), *size, add, [](const auto& model) { return model->name; },
      response->mutable_next_page_token());
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
