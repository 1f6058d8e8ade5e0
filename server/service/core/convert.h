// Between messages and domain types. Every function that reads a message checks it; errors name the field.
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>
#include <grpcpp/support/status.h>

#include "server/service/core/resources.h"
#include "server/touch/commanded_touch.h"
#include "touchstone/v1/models.pb.h"
#include "touchstone/v1/types.pb.h"

namespace touchstone::service {

grpc::Status ToGrpc(const absl::Status& status);

absl::StatusOr<touch::CommandedTouch> FromProto(const v1::CommandedTouch& message, const std::string& where);
v1::CommandedTouch ToProto(const touch::CommandedTouch& touch);

absl::StatusOr<std::shared_ptr<const model::Model>> FromProto(const v1::ModelRef& message,
                                                              const Resources& resources);

v1::Effect ToProto(const model::Effect& effect);
v1::Model ToProto(const model::Model& model);
v1::Vector3 ToProto(const Eigen::Vector3d& v);
Eigen::Vector3d FromProto(const v1::Vector3& v);

}  // namespace touchstone::service
