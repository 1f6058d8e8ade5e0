#include "server/model/surface_map_file.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::model {
namespace {

constexpr int kMapColumns = 8;
constexpr std::array<const char*, kMapColumns> kMapHeader = {
    "object", "x_mm", "y_mm", "z_mm", "departure_mm", "std_dev_mm", "length_mm", "rms_mm"};
constexpr double kMaxPlaceMm = 1e5;
constexpr double kMaxDepartureMm = 20;
constexpr double kMinLengthMm = 0.1, kMaxLengthMm = 1e4;

struct MapRange {
  double lower, upper;
};
// Of the columns behind the object.
constexpr std::array<MapRange, kMapColumns - 1> kMapRanges = {{{-kMaxPlaceMm, kMaxPlaceMm},
                                                               {-kMaxPlaceMm, kMaxPlaceMm},
                                                               {-kMaxPlaceMm, kMaxPlaceMm},
                                                               {-kMaxDepartureMm, kMaxDepartureMm},
                                                               {0, kMaxDepartureMm},
                                                               {kMinLengthMm, kMaxLengthMm},
                                                               {0, kMaxDepartureMm}}};

template <typename... Parts>
absl::Status MapError(const std::string& origin, size_t line, const Parts&... parts) {
  return absl::InvalidArgumentError(absl::StrCat(origin, ":", line, ": ", parts...));
}

absl::Status CheckMapName(const std::string& origin, size_t line, absl::string_view name) {
  const bool plain = std::all_of(name.begin(), name.end(), [](unsigned char c) {
    return !absl::ascii_iscntrl(c) && c != '"' && c != ',';
  });
  if (!name.empty() && name.size() <= 200 && plain) return absl::OkStatus();
  return MapError(origin, line, "column object: '", name.substr(0, 40),
                  "'; the name of an object was expected, without quotes");
}

}  // namespace

absl::StatusOr<std::map<std::string, SurfaceMapObject>> ParseSurfaceMap(const std::string& text,
                                                                        const std::string& origin) {
  std::map<std::string, SurfaceMapObject> objects;
  absl::string_view rest = text, whole_line;
  const std::string header = absl::StrJoin(kMapHeader, ",");
  bool begun = false;
  for (size_t number = 1; NextLine(&rest, &whole_line); ++number) {
    const absl::string_view line = absl::StripTrailingAsciiWhitespace(whole_line);
    if (line.empty() || (!begun && line[0] == '#')) continue;
    if (!begun) {
      if (line != header)
        return MapError(origin, number, "'", line.substr(0, 60), "'; the header '", header, "' was expected");
      begun = true;
      continue;
    }
    const std::vector<absl::string_view> fields = absl::StrSplit(line, ',');
    if (fields.size() != kMapColumns)
      return MapError(origin, number, fields.size(), " fields; ", kMapColumns, " were expected: ", header);
    TOUCHSTONE_RETURN_IF_ERROR(CheckMapName(origin, number, fields[0]));
    std::array<double, kMapColumns - 1> values{};
    for (size_t c = 1; c < kMapColumns; ++c) {
      const absl::StatusOr<double> value = ParseNumber(absl::StripAsciiWhitespace(fields[c]));
      if (!value.ok())
        return MapError(origin, number, "column ", kMapHeader[c], ": ", value.status().message());
      const MapRange& range = kMapRanges[c - 1];
      if (!(*value >= range.lower && *value <= range.upper))
        return MapError(origin, number, "column ", kMapHeader[c], ": ", ShortestNumber(*value),
                        " is out of range; ", ShortestNumber(range.lower), " to ",
                        ShortestNumber(range.upper));
      values[c - 1] = *value == 0 ? 0.0 : *value;  // no negative zero: equal maps, equal text
    }
    SurfaceMapObject& object = objects[std::string(fields[0])];
    if (object.points.empty()) object.length_mm = values[5], object.rms_mm = values[6];
    if (object.length_mm != values[5] || object.rms_mm != values[6])
      return MapError(origin, number, "object '", fields[0], "' has length_mm ", ShortestNumber(values[5]),
                      " and rms_mm ", ShortestNumber(values[6]), " here and ",
                      ShortestNumber(object.length_mm), " and ", ShortestNumber(object.rms_mm),
                      " further up; an object has one of each");
    if (object.points.size() == kMaxSurfaceMapPoints)
      return MapError(origin, number, "object '", fields[0], "' has more than ", kMaxSurfaceMapPoints,
                      " points");
    object.points.push_back({{values[0], values[1], values[2]}, values[3], values[4]});
  }
  if (objects.empty())
    return absl::InvalidArgumentError(
        absl::StrCat(origin, ": no point; the header '", header, "' and a line per point were expected"));
  return objects;
}

std::string FormatSurfaceMap(const std::map<std::string, SurfaceMapObject>& objects) {
  std::string text = absl::StrCat(absl::StrJoin(kMapHeader, ","), "\n");
  for (const auto& [name, object] : objects) {
    const std::string rest =
        absl::StrCat(",", ShortestNumber(object.length_mm), ",", ShortestNumber(object.rms_mm), "\n");
    for (const SurfaceMapPoint& point : object.points) {
      absl::StrAppend(&text, name);
      for (const double x : point.position_mm) absl::StrAppend(&text, ",", ShortestNumber(x));
      absl::StrAppend(&text, ",", ShortestNumber(point.departure_mm), ",", ShortestNumber(point.std_dev_mm),
                      rest);
    }
  }
  return text;
}

std::string SurfaceMapInWords(const SurfaceMapSpec& spec) {
  size_t points = 0;
  for (const auto& [name, object] : spec.objects) points += object.points.size();
  return absl::StrCat("departures of ", spec.objects.size(),
                      spec.objects.size() == 1 ? " object" : " objects", " at ", points,
                      points == 1 ? " point" : " points");
}

}  // namespace touchstone::model
