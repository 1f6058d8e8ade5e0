#include "client/source/dataset/lab_units.h"

#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "client/source/dataset/batch.h"
#include "server/base/text/text.h"

namespace touchstone::client {
namespace {

struct Suffix {
  const char* si;
  const char* lab;
  Unit unit;
};

// Longest first: "_m_s" ends in "_s" too.
constexpr Suffix kSuffixes[] = {
    {"_m_s", "_mm_s", Unit::kMillimetrePerSecond},
    {"_rad", "_deg", Unit::kDegree},
    {"_m", "_mm", Unit::kMillimetre},
    {"_s", "_us", Unit::kMicrosecond},
};

// Conditions of a session, not results: people write them in seconds.
bool StaysInSeconds(const std::string& name) {
  return name == "session_time_s" || name == "touch_interval_s";
}

bool EndsWith(const std::string& text, const char* end) {
  const size_t size = std::strlen(end);
  return text.size() > size && text.compare(text.size() - size, size, end) == 0;
}

std::string Replaced(const std::string& name, const char* end, const char* by) {
  return name.substr(0, name.size() - std::strlen(end)) + by;
}

using Json = nlohmann::ordered_json;

// Every number in `value` through `convert`; strings (protobuf's "NaN") stay.
template <typename Convert>
Json ConvertNumbers(const Json& value, const Convert& convert) {
  if (value.is_number()) return convert(value.get<double>());
  if (!value.is_structured()) return value;
  Json result = value;
  for (auto& item : result) item = ConvertNumbers(item, convert);
  return result;
}

// Walks an object: `rename` gives a key's new name and unit, `convert` a number's new value.
template <typename Rename, typename Convert>
Json Walk(const Json& value, const Rename& rename, const Convert& convert) {
  if (value.is_array()) {
    Json result = Json::array();
    for (const Json& item : value) result.push_back(Walk(item, rename, convert));
    return result;
  }
  if (!value.is_object()) return value;
  Json result = Json::object();
  for (const auto& [key, item] : value.items()) {
    if (key == "covariates") {
      result[key] = item;
      continue;
    }
    const LabName renamed = rename(key);
    result[renamed.name] =
        renamed.unit == Unit::kNone
            ? Walk(item, rename, convert)
            : ConvertNumbers(item, [&](double number) { return convert(renamed.unit, number); });
  }
  return result;
}

template <typename T>
void AppendScaled(Unit unit, const v1::Column& wire, size_t first, size_t count, std::string* bytes) {
  const size_t begin = bytes->size();
  bytes->resize(begin + count * sizeof(T));
  const char* from = wire.data().data() + first * sizeof(T);
  char* to = &(*bytes)[begin];
  for (size_t i = 0; i < count; ++i) {
    T value;
    std::memcpy(&value, from + i * sizeof(T), sizeof(T));
    value = static_cast<T>(FromSi(unit, static_cast<double>(value)));
    std::memcpy(to + i * sizeof(T), &value, sizeof(T));
  }
}

}  // namespace

LabName LabNameOf(const std::string& si_name) {
  if (!StaysInSeconds(si_name))
    for (const Suffix& suffix : kSuffixes)
      if (EndsWith(si_name, suffix.si)) return {Replaced(si_name, suffix.si, suffix.lab), suffix.unit};
  return {si_name, Unit::kNone};
}

LabName SiNameOf(const std::string& lab_name) {
  for (const Suffix& suffix : kSuffixes)
    if (EndsWith(lab_name, suffix.lab)) return {Replaced(lab_name, suffix.lab, suffix.si), suffix.unit};
  return {lab_name, Unit::kNone};
}

double LabNumber(Unit unit, double value_in_si) {
  const double plain = FromSi(unit, value_in_si);
  if (unit == Unit::kNone || !std::isfinite(plain)) return plain;
  // A lab's number has few digits: if fifteen come back to the same SI value, they are what was meant.
  char text[64];
  std::snprintf(text, sizeof text, "%.15g", plain);
  const double candidate = std::strtod(text, nullptr);
  return ToSi(unit, candidate) == value_in_si ? candidate : plain;
}

std::string LabText(const FileColumn& column, const v1::Column& wire, size_t i) {
  const double value = ValueAsDouble(wire, i);
  if (column.type == v1::DATA_TYPE_FLOAT64) return ShortestNumber(LabNumber(column.unit, value));
  if (column.type != v1::DATA_TYPE_FLOAT32) return ShortestNumber(value);
  // A float's shortest decimal, its unit changed: with the units' powers of ten the digits stay as they are.
  constexpr int kMaxDigitsOfFloat = 9;
  char text[64];
  const auto shortest = std::to_chars(text, text + sizeof text, static_cast<float>(value));
  double decimal = value;
  std::from_chars(text, shortest.ptr, decimal);
  const auto end = std::to_chars(text, text + sizeof text, FromSi(column.unit, decimal),
                                 std::chars_format::general, kMaxDigitsOfFloat);
  return std::string(text, end.ptr);
}

Json ToLabUnits(const Json& si) {
  return Walk(si, LabNameOf, LabNumber);
}

Json ToSiUnits(const Json& lab) {
  return Walk(lab, SiNameOf, ToSi);
}

uint64_t FileColumn::Values() const {
  uint64_t values = 1;
  for (const uint64_t side : shape) values *= side;
  return values;
}

FileColumn FileColumnOf(const v1::Column& column) {
  FileColumn result;
  result.wire_name = column.name();
  result.type = column.type();
  result.shape.assign(column.shape().begin(), column.shape().end());
  const bool real = column.type() == v1::DATA_TYPE_FLOAT32 || column.type() == v1::DATA_TYPE_FLOAT64;
  const LabName lab = real ? LabNameOf(column.name()) : LabName{column.name(), Unit::kNone};
  result.name = lab.name;
  result.unit = lab.unit;
  return result;
}

void AppendLabValues(const FileColumn& column, const v1::Column& wire, uint64_t first_row, uint64_t rows,
                     std::string* bytes) {
  const size_t values = column.Values();
  const size_t first = first_row * values;
  const size_t count = rows * values;
  if (column.unit != Unit::kNone && column.type == v1::DATA_TYPE_FLOAT32) {
    AppendScaled<float>(column.unit, wire, first, count, bytes);
  } else if (column.unit != Unit::kNone && column.type == v1::DATA_TYPE_FLOAT64) {
    AppendScaled<double>(column.unit, wire, first, count, bytes);
  } else {
    const size_t size = BytesPerValue(column.type);
    bytes->append(wire.data(), first * size, count * size);
  }
}

}  // namespace touchstone::client
