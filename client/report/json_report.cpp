#include <absl/strings/str_cat.h>
#include <google/protobuf/util/json_util.h>

#include "client/report/report.h"

namespace touchstone::client {

absl::StatusOr<std::string> JsonReport(const v1::Report& report) {
  v1::Report complete = report;
  for (v1::DataReport& data : *complete.mutable_data())
    data.mutable_initial(), data.mutable_final(), data.mutable_unexplained();
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string json;
  const auto status = google::protobuf::util::MessageToJsonString(complete, &json, options);
  if (!status.ok()) {
    return absl::InternalError(absl::StrCat("the report cannot be written as JSON: ",
                                            std::string(status.message().data(), status.message().size())));
  }
  return json;
}

}  // namespace touchstone::client
