// Between messages and domain types. Every function that reads a message checks it; errors name the field.
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>
#include <grpcpp/support/status.h>

#include "server/dataset/stream.h"
#include "server/service/resources.h"
#include "touchstone/v1/models.pb.h"
#include "touchstone/v1/source.pb.h"
#include "touchstone/v1/types.pb.h"

namespace touchstone {

grpc::Status ToGrpc(const absl::Status& status);

absl::StatusOr<CommandedTouch> FromProto(const v1::CommandedTouch& message, const std::string& where);
v1::CommandedTouch ToProto(const CommandedTouch& touch);

// Touch ids: none, or one a touch, of a sensible length.
absl::Status CheckTouchIds(const v1::TouchRequest& request);

absl::StatusOr<Camera> FromProto(const v1::View& message, const std::string& where);

absl::StatusOr<Plan> FromProto(const v1::Plan& message);
absl::StatusOr<std::shared_ptr<const Model>> FromProto(const v1::ModelRef& message,
                                                       const Resources& resources);

// Image options with the source's defaults; `renderer` is resolved.
absl::StatusOr<DatasetImage> FromProto(const v1::ImageSpec& message, Resources* resources);

absl::StatusOr<std::shared_ptr<const DatasetSpecification>> FromProto(const v1::DatasetSpec& message,
                                                                      Resources* resources);

v1::RendererKind RendererKindOf(const Renderer& renderer);
v1::Column ColumnToProto(const ColumnInfo& info);
// What a dataset is, resolved: the first message of its stream.
v1::DatasetHeader HeaderOf(const DatasetSpecification& specification);
v1::Batch ToProto(DatasetBatch batch, const std::vector<ColumnInfo>& columns);
v1::Effect ToProto(const Effect& effect);
v1::Model ToProto(const Model& model);
v1::Vector3 ToProto(const Eigen::Vector3d& v);
Eigen::Vector3d FromProto(const v1::Vector3& v);

}  // namespace touchstone
