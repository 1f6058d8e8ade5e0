// touchstone.v1.Models: the store of models and the catalogue of effects.
#pragma once

#include "server/service/core/resources.h"
#include "touchstone/v1/models.grpc.pb.h"

namespace touchstone::service {

class ModelsService final : public v1::Models::Service {
 public:
  explicit ModelsService(Resources* resources) : resources_(resources) {}

  grpc::Status ListEffects(grpc::ServerContext*, const v1::ListEffectsRequest*,
                           v1::ListEffectsResponse*) override;
  grpc::Status ListModels(grpc::ServerContext*, const v1::ListModelsRequest*,
                          v1::ListModelsResponse*) override;
  grpc::Status GetModel(grpc::ServerContext*, const v1::GetModelRequest*, v1::Model*) override;
  grpc::Status CreateModel(grpc::ServerContext*, const v1::CreateModelRequest*, v1::Model*) override;

 private:
  Resources* resources_;
};

}  // namespace touchstone::service
