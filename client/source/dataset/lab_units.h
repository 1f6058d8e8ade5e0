// Names and numbers of the wire (SI) as files and the command line have them (mm, us, deg, mm/s).
// The factors are server/base/units.h's.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "server/base/units.h"
#include "touchstone/v1/types.pb.h"

namespace touchstone::client {

// "descriptor_s" -> {"descriptor_us", kMicrosecond}, "target_m" -> {"target_mm", kMillimetre}. A name
// without a unit that files write differently keeps its name with kNone; session_time_s and
// touch_interval_s stay seconds.
struct LabName {
  std::string name;
  Unit unit = Unit::kNone;
};
LabName LabNameOf(const std::string& si_name);

// The other way: "target_mm" -> {"target_m", kMillimetre}.
LabName SiNameOf(const std::string& lab_name);

// The file's number for an SI value: the shortest decimal that ToSi turns into exactly this value again,
// where there is one within rounding; else FromSi's.
double LabNumber(Unit unit, double value_in_si);

// A JSON object of SI values as protobuf prints it, with names and numbers in the units of files; and back.
// Goes through nested objects and arrays, but not into "covariates", whose names are the user's.
nlohmann::ordered_json ToLabUnits(const nlohmann::ordered_json& si);
nlohmann::ordered_json ToSiUnits(const nlohmann::ordered_json& lab);

// One column of a dataset as files hold it.
struct FileColumn {
  std::string wire_name;    // "descriptor_s"
  std::string name;         // "descriptor_us"
  Unit unit = Unit::kNone;  // of the numbers in files
  v1::DataType type = v1::DATA_TYPE_UNSPECIFIED;
  std::vector<uint64_t> shape;  // of one sample

  uint64_t Values() const;  // of one sample
};
FileColumn FileColumnOf(const v1::Column& column);

// Value `i` of a numeric column in the unit of files: the shortest text that reads back as the same number of
// the column's type.
std::string LabText(const FileColumn& column, const v1::Column& wire, size_t i);

// Appends samples first_row .. first_row + rows - 1 of a numeric column, little endian, in the units of files
// and in the column's own type.
void AppendLabValues(const FileColumn& column, const v1::Column& wire, uint64_t first_row, uint64_t rows,
                     std::string* bytes);

}  // namespace touchstone::client
