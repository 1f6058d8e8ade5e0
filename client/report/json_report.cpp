#include <absl/strings/str_cat.h>
#include <google/protobuf/util/json_util.h>

#include "client/report/report.h"
#include "client/report/report_json.h"

namespace touchstone::client {

absl::StatusOr<std::string> ReportToJson(v1::Report report, bool whitespace) {
  for (v1::DataReport& data : *report.mutable_data())
    data.mutable_initial(), data.mutable_final(), data.mutable_unexplained();
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = whitespace;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string json;
  const auto status = google::protobuf::util::MessageToJsonString(report, &json, options);
  if (!status.ok()) {
    return absl::InternalError(absl::StrCat("the report cannot be written as JSON: ",
                                            std::string(status.message().data(), status.message().size())));
  }
  return json;
}

absl::StatusOr<std::string> JsonReport(const v1::Report& report) {
  v1::Report shown = report;
  for (v1::DataReport& data : *shown.mutable_data()) data.clear_touch_table();
  return ReportToJson(std::move(shown), /*whitespace=*/true);
}

}  // namespace touchstone::client
