#include "client/source/dataset/sample_text.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::client {
namespace {

// JSON has no word for what is not a number.
std::string JsonNumber(std::string text) {
  return text.find("nan") != std::string::npos || text.find("inf") != std::string::npos ? "null" : text;
}

}  // namespace

bool IsPoseColumn(const FileColumn& column) {
  const std::string& name = column.wire_name;
  return name == "target_m" || name == "approach" || name == "lateral" || name == "standoff_m" ||
         name == "speed_m_s";
}

absl::StatusOr<std::string> ObjectOfSample(const DatasetLayout& layout, const Batch& batch, uint64_t row) {
  const v1::Column* column = batch.Find("object");
  // Without the column: the rule of DatasetSpec.objects.
  const double number = column != nullptr
                            ? ValueAsDouble(*column, row)
                            : static_cast<double>((batch.start_index() + row) % layout.objects.size());
  if (!(number >= 0 && number < static_cast<double>(layout.objects.size())))
    return absl::InternalError(absl::StrCat("sample ", batch.start_index() + row, " shows object ", number,
                                            " of ", layout.objects.size()));
  return layout.objects[static_cast<size_t>(number)];
}

absl::StatusOr<std::string> SampleJson(const DatasetLayout& layout, const Batch& batch, uint64_t row) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string object, ObjectOfSample(layout, batch, row));
  std::string json =
      absl::StrCat("{\"index\":", batch.start_index() + row, ",\"object\":", nlohmann::json(object).dump());
  for (const FileColumn& column : layout.columns) {
    const bool scalar = column.shape.empty() && column.wire_name != "index" && column.wire_name != "object";
    if (column.type == v1::DATA_TYPE_BYTES || (!scalar && !IsPoseColumn(column))) continue;
    const v1::Column* wire = batch.Find(column.wire_name);
    const size_t values = column.Values();
    absl::StrAppend(&json, ",\"", column.name, "\":", column.shape.empty() ? "" : "[");
    for (size_t i = 0; i < values; ++i)
      absl::StrAppend(&json, i == 0 ? "" : ",", JsonNumber(LabText(column, *wire, row * values + i)));
    if (!column.shape.empty()) json.push_back(']');
  }
  json.push_back('}');
  return json;
}

absl::StatusOr<std::string> SampleMeasurementRow(const DatasetLayout& layout, const Batch& batch,
                                                 uint64_t row) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string object, ObjectOfSample(layout, batch, row));
  std::string text = absl::StrCat(batch.start_index() + row, ",", object);
  // The order of MeasurementHeader.
  const bool contact_times = layout.FindColumn("contact_time_s") != nullptr;
  for (const char* name : {"speed_m_s", "standoff_m", "target_m", "approach", "lateral",
                           contact_times ? "contact_time_s" : "descriptor_s"}) {
    const FileColumn* column = layout.FindColumn(name);
    const v1::Column* wire = batch.Find(name);
    if (column == nullptr || wire == nullptr)
      return absl::InvalidArgumentError(
          "a folder holds a measurement file, which needs the columns pose and contact_time or descriptor");
    const size_t values = column->Values();
    for (size_t i = 0; i < values; ++i) {
      const std::string number = LabText(*column, *wire, row * values + i);
      absl::StrAppend(&text, ",", number == "nan" ? "" : number);
    }
  }
  text.push_back('\n');
  return text;
}

absl::StatusOr<std::vector<const v1::Column*>> MatchColumns(const DatasetLayout& layout, const Batch& batch) {
  std::vector<const v1::Column*> result;
  for (const FileColumn& column : layout.columns) {
    const v1::Column* wire = batch.Find(column.wire_name);
    if (wire == nullptr || wire->type() != column.type ||
        !std::equal(wire->shape().begin(), wire->shape().end(), column.shape.begin(), column.shape.end()))
      return absl::InternalError(absl::StrCat("the batch at sample ", batch.start_index(), " has no column '",
                                              column.wire_name,
                                              "' of the type and shape that the header promised"));
    TOUCHSTONE_RETURN_IF_ERROR(ValidateColumn(*wire, batch.rows()));
    result.push_back(wire);
  }
  return result;
}

}  // namespace touchstone::client
