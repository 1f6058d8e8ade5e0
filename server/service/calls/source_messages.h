// Between the messages of touchstone.v1.Source and the requests and results of a source. Every function that reads
// a message checks what the message alone can say; errors name the field. What depends on the source, its limits
// and its objects, the source checks.
#pragma once

#include <absl/status/statusor.h>

#include "server/service/core/resources.h"
#include "server/source/source.h"
#include "touchstone/v1/source.pb.h"

namespace touchstone::service {

absl::StatusOr<image::Camera> FromProto(const v1::View& message, const std::string& where);
absl::StatusOr<touch::Plan> FromProto(const v1::Plan& message);
absl::StatusOr<dataset::DatasetImage> FromProto(const v1::ImageSpec& message);  // with its defaults

absl::StatusOr<source::PlanRequest> FromProto(const v1::ExpandPlanRequest& message,
                                              const Resources& resources);
absl::StatusOr<source::TouchRequest> FromProto(const v1::TouchRequest& message, const Resources& resources);
absl::StatusOr<source::CaptureRequest> FromProto(const v1::CaptureRequest& message,
                                                 const Resources& resources);
absl::StatusOr<source::SampleRequest> FromProto(const v1::StreamDatasetRequest& message,
                                                const Resources& resources);

v1::DescribeResponse ToProto(const source::SourceInfo& info, const Limits& limits);
v1::ListObjectsResponse ToProto(const source::ObjectStore& objects);
v1::ExpandPlanResponse ToProto(const source::ExpandedPlan& plan);
v1::TouchResponse ToProto(const source::TouchResults& results);
v1::CaptureResponse ToProto(source::CaptureResults results);
v1::DatasetHeader ToProto(const source::SampleHeader& header);
v1::Batch ToProto(dataset::DatasetBatch batch, const std::vector<dataset::ColumnInfo>& columns);

}  // namespace touchstone::service
