#include "server/session/images/images_csv.h"

#include <absl/container/flat_hash_map.h>
#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include <cmath>
#include <set>

#include <Eigen/Geometry>

#include "server/base/status.h"
#include "server/base/text/file_number.h"
#include "server/base/text/text.h"
#include "server/base/touch_limits.h"
#include "server/base/units.h"
#include "server/model/parameter_values.h"
#include "server/session/csv/csv_fields.h"
#include "server/session/images/image_columns.h"
#include "server/session/measurements/measurement_checks.h"

namespace touchstone::session {
namespace {

constexpr size_t kMaxImageColumns = 4096;
constexpr double kMaxDistanceM = 1000;  // of eye and at from the object's origin
constexpr double kMinViewM = 1e-6;      // from eye to at
constexpr double kMinUpLength = 1e-6;
constexpr double kMinUpSine = 1e-3;  // between up and the view: nearer, the roll is not known
constexpr double kLargestImageCount = 9e15;

double& PartOf(CameraPlacement* placement, int part) {
  Eigen::Vector3d& vector = part < 3 ? placement->eye_m : part < 6 ? placement->at_m : placement->up;
  return vector[part % 3];
}
double PartOf(const CameraPlacement& placement, int part) {
  return part < 3 ? placement.eye_m[part] : part < 6 ? placement.at_m[part - 3] : placement.up[part - 6];
}

// Why a placement gives no view; empty: it does.
std::string WrongPlacement(const CameraPlacement& placement, absl::string_view prefix) {
  const std::string eye = VectorText(placement.eye_m, Unit::kMillimetre),
                    at = VectorText(placement.at_m, Unit::kMillimetre), up = VectorText(placement.up);
  const Eigen::Vector3d view = placement.at_m - placement.eye_m;
  if (view.norm() < kMinViewM)
    return absl::StrCat("columns ", prefix, "eye_* and ", prefix, "at_*: the camera at ", eye,
                        " mm looks at itself; another point was expected, the one that it looks at");
  const double length = placement.up.norm();
  if (length < kMinUpLength)
    return absl::StrCat("columns ", prefix, "up_*: ", up, " has length ", ShortestNumber(length),
                        "; a vector towards the picture's upper edge was expected");
  if (view.normalized().cross(placement.up / length).norm() < kMinUpSine)
    return absl::StrCat("columns ", prefix, "up_*: ", up, " is parallel to the view from ", eye, " to ", at,
                        " mm; a vector towards the picture's upper edge was expected");
  return "";
}

class ImageRowReader {
 public:
  ImageRowReader(const std::vector<ImageColumn>& columns, ImageSet* set) : columns_(columns), set_(*set) {}

  absl::Status Read(const std::vector<absl::string_view>& fields, int line) {
    line_ = line;
    fields_ = &fields;
    if (fields.size() != columns_.size())
      return Wrong(absl::StrCat("has ", fields.size(), " columns, the header has ", columns_.size()));
    PhotographRow row;
    row.line = line;
    CameraPlacement measured;
    int measured_parts = 0;
    for (size_t i = 0; i < fields.size(); ++i) {
      const ImageColumn& column = columns_[i];
      if (column.kind == ImageColumnKind::kMeasured) {
        if (fields[i].empty()) continue;
        ++measured_parts;
        TOUCHSTONE_ASSIGN_OR_RETURN(PartOf(&measured, column.index), Part(i));
      } else {
        TOUCHSTONE_RETURN_IF_ERROR(ReadField(i, &row));
      }
    }
    if (measured_parts > 0 && measured_parts < kPlacementParts)
      return Wrong(absl::StrCat("columns measured_*: ", measured_parts, " of ", kPlacementParts,
                                " are filled; the whole measured pose was expected, or nothing"));
    if (const std::string wrong = WrongPlacement(row.commanded, ""); !wrong.empty()) return Wrong(wrong);
    if (measured_parts > 0) {
      if (const std::string wrong = WrongPlacement(measured, kMeasuredPrefix); !wrong.empty())
        return Wrong(wrong);
      row.measured = measured;
      set_.has_measured = true;
    }
    set_.photographs.push_back(std::move(row));
    return absl::OkStatus();
  }

 private:
  absl::Status ReadField(size_t i, PhotographRow* row) {
    const ImageColumn& column = columns_[i];
    const absl::string_view field = (*fields_)[i];
    switch (column.kind) {
      case ImageColumnKind::kImage: {
        TOUCHSTONE_ASSIGN_OR_RETURN(const double number, Whole(i, kLargestImageCount));
        row->image = static_cast<uint64_t>(number);
        return CheckNew(i, row->image, absl::StrCat(row->image), &images_);
      }
      case ImageColumnKind::kFile:
        if (const absl::Status status = CheckPictureName(field); !status.ok())
          return WrongField(i, std::string(status.message()));
        row->file = std::string(field);
        return CheckNew(i, row->file, absl::StrCat("'", row->file, "'"), &files_);
      case ImageColumnKind::kObject:
        return ReadObject(i, field, row);
      case ImageColumnKind::kCommanded: {
        TOUCHSTONE_ASSIGN_OR_RETURN(PartOf(&row->commanded, column.index), Part(i));
        return absl::OkStatus();
      }
      case ImageColumnKind::kMeasured:
        return absl::OkStatus();
      case ImageColumnKind::kSessionTime: {
        TOUCHSTONE_ASSIGN_OR_RETURN(row->session_time_s, Number(i));
        if (!(row->session_time_s >= 0 && row->session_time_s <= kMaxSessionTimeS))
          return WrongField(
              i, absl::StrCat(Shown(field), " is out of range; seconds from 0 to 1e9 since the session ",
                              "began were expected"));
        return absl::OkStatus();
      }
      case ImageColumnKind::kRound: {
        if (field.empty()) return absl::OkStatus();
        TOUCHSTONE_ASSIGN_OR_RETURN(const double number, Whole(i, INT32_MAX));
        row->round = static_cast<int>(number);
        return absl::OkStatus();
      }
      case ImageColumnKind::kTouch: {
        if (field.empty()) return absl::OkStatus();
        TOUCHSTONE_ASSIGN_OR_RETURN(const double number, Whole(i, kLargestImageCount));
        row->touch = static_cast<uint64_t>(number);
        return absl::OkStatus();
      }
      case ImageColumnKind::kCovariate: {
        if (field.empty()) return absl::OkStatus();
        TOUCHSTONE_ASSIGN_OR_RETURN(row->covariates[column.name], Number(i));
        return absl::OkStatus();
      }
    }
    return absl::OkStatus();
  }

  // A number or file that stands twice would make "picture 17" ambiguous, and hints at rows pasted twice.
  template <typename Key>
  absl::Status CheckNew(size_t i, const Key& key, const std::string& words,
                        absl::flat_hash_map<Key, int>* seen) const {
    const auto [at, first] = seen->try_emplace(key, line_);
    if (first) return absl::OkStatus();
    return WrongField(
        i, absl::StrCat(words, " stands in line ", at->second, " already; each picture was expected once"));
  }

  absl::Status ReadObject(size_t i, absl::string_view name, PhotographRow* row) {
    if (name.empty()) return WrongField(i, "is empty; a name was expected");
    if (name.size() > kMaxObjectNameBytes || !IsText(name))
      return WrongField(i, absl::StrCat("'", Shown(name), "' is no name: at most ", kMaxObjectNameBytes,
                                        " bytes of UTF-8 without control characters were expected"));
    const auto [found, is_new] = objects_.try_emplace(std::string(name), static_cast<int>(objects_.size()));
    if (is_new) set_.objects.emplace_back(name);
    row->object = found->second;
    return absl::OkStatus();
  }

  // A part of a placement, in SI.
  absl::StatusOr<double> Part(size_t i) const {
    TOUCHSTONE_ASSIGN_OR_RETURN(const double value, Number(i));
    const double si = IsLength(columns_[i].index) ? ToSi(Unit::kMillimetre, value) : value;
    if (std::abs(si) <= kMaxDistanceM) return si;
    return WrongField(i, absl::StrCat(Shown((*fields_)[i]), " is out of range; ",
                                      IsLength(columns_[i].index)
                                          ? "a coordinate within 1e6 mm of the object's origin was expected"
                                          : "a direction's component within 1000 was expected"));
  }

  absl::StatusOr<double> Number(size_t i) const {
    const absl::StatusOr<double> read = FieldNumber((*fields_)[i]);
    if (!read.ok()) return WrongField(i, std::string(read.status().message()));
    if (!std::isfinite(*read))
      return WrongField(i, absl::StrCat("'", Shown((*fields_)[i]), "' is not a finite number"));
    return *read;
  }

  absl::StatusOr<double> Whole(size_t i, double highest) const {
    TOUCHSTONE_ASSIGN_OR_RETURN(const double value, Number(i));
    if (value >= 0 && value <= highest && value == std::floor(value)) return value;
    return WrongField(i, absl::StrCat(Shown((*fields_)[i]), " is not a whole number from 0 on"));
  }

  absl::Status WrongField(size_t i, const std::string& what) const {
    return Wrong(absl::StrCat("column ", columns_[i].name, ": ", what, " (field ", i + 1, " of the row)"));
  }
  absl::Status Wrong(const std::string& what) const {
    return absl::InvalidArgumentError(absl::StrCat(set_.origin, ":", line_, ": ", what));
  }

  const std::vector<ImageColumn>& columns_;
  ImageSet& set_;
  absl::flat_hash_map<std::string, int> objects_, files_;
  absl::flat_hash_map<uint64_t, int> images_;
  const std::vector<absl::string_view>* fields_ = nullptr;
  int line_ = 0;
};

}  // namespace

absl::Status CheckPictureName(absl::string_view name) {
  const auto wrong = [&](absl::string_view what) {
    return absl::InvalidArgumentError(absl::StrCat("'", Shown(name), "' ", what));
  };
  if (name.empty()) return absl::InvalidArgumentError("is empty; the name of a PNG file was expected");
  if (name.size() > kMaxPictureNameBytes || !IsText(name))
    return wrong(absl::StrCat("is no name: at most ", kMaxPictureNameBytes,
                              " bytes of UTF-8 without control characters were expected"));
  if (name[0] == '/' || absl::StrContains(name, '\\'))
    return wrong("is no path in the folder: one relative to it, with '/', was expected");
  for (const absl::string_view part : absl::StrSplit(name, '/'))
    if (part.empty() || part == "." || part == "..")
      return wrong("is no plain path in the folder: one without '.', '..' and '//' was expected");
  if (name == "images.csv" || name == "camera.yaml" || name == "touches.csv")
    return wrong("is a file of the set itself; a PNG file was expected");
  return absl::OkStatus();
}

absl::StatusOr<ImageSet> ParseImagesCsv(absl::string_view csv, const std::string& origin) {
  ImageSet set;
  set.origin = origin;
  const auto wrong = [&](int line, absl::string_view what) {
    return absl::InvalidArgumentError(absl::StrCat(origin, ":", line, ": ", what));
  };
  TOUCHSTONE_ASSIGN_OR_RETURN(CsvLines lines, CsvLines::Open(csv, origin));
  CsvFields fields;
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const std::vector<std::string> names,
      ReadCsvHeader(origin, "image,file,object,eye_x_mm,...", kMaxImageColumns, &lines, &fields));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<ImageColumn> columns, ReadImageColumns(names, origin));
  for (const ImageColumn& column : columns) {
    set.has_session_time = set.has_session_time || column.kind == ImageColumnKind::kSessionTime;
    set.has_round = set.has_round || column.kind == ImageColumnKind::kRound;
  }
  ImageRowReader reader(columns, &set);
  for (absl::string_view row; lines.Next(&row);) {
    if (absl::StripAsciiWhitespace(row).empty()) continue;
    if (set.size() == kMaxPhotographs)
      return wrong(lines.number(), absl::StrCat("at most ", kMaxPhotographs, " photographs are read"));
    if (absl::Status status = fields.Cut(row); !status.ok()) return wrong(lines.number(), status.message());
    TOUCHSTONE_RETURN_IF_ERROR(reader.Read(fields.all(), lines.number()));
  }
  if (set.size() == 0) return wrong(2, "the file has a header but no photograph; rows were expected");
  return set;
}

ImageColumns ColumnsOf(const ImageSet& set) {
  ImageColumns columns;
  columns.session_time = set.has_session_time;
  columns.round = set.has_round;
  std::set<std::string> names;
  for (const PhotographRow& row : set.photographs) {
    columns.touch = columns.touch || row.touch;
    columns.measured = columns.measured || row.measured;
    for (const auto& [name, value] : row.covariates) names.insert(name);
  }
  columns.covariates.assign(names.begin(), names.end());
  return columns;
}

std::string ImagesCsvHeader(const ImageColumns& columns) {
  std::string line = "image,file,object";
  for (const char* part : kPlacementNames) absl::StrAppend(&line, ",", part);
  if (columns.session_time) line += ",session_time_s";
  if (columns.round) line += ",round";
  if (columns.touch) line += ",touch";
  if (columns.measured)
    for (const char* part : kPlacementNames) absl::StrAppend(&line, ",", kMeasuredPrefix, part);
  for (const std::string& name : columns.covariates) absl::StrAppend(&line, ",", name);
  return line + "\n";
}

std::string ImagesCsvRow(const PhotographRow& row, const std::string& object, const ImageColumns& columns) {
  std::string line = absl::StrCat(row.image, ",", QuotedField(row.file), ",", QuotedField(object));
  const auto append = [&line](const CameraPlacement& placement) {
    for (int part = 0; part < kPlacementParts; ++part)
      absl::StrAppend(&line, ",",
                      IsLength(part) ? FileNumber(Unit::kMillimetre, PartOf(placement, part))
                                     : ShortestNumber(PartOf(placement, part)));
  };
  append(row.commanded);
  if (columns.session_time) absl::StrAppend(&line, ",", ShortestNumber(row.session_time_s));
  if (columns.round) absl::StrAppend(&line, ",", row.round < 0 ? "" : absl::StrCat(row.round));
  if (columns.touch) absl::StrAppend(&line, ",", row.touch ? absl::StrCat(*row.touch) : "");
  if (columns.measured && row.measured) append(*row.measured);
  if (columns.measured && !row.measured) line += std::string(kPlacementParts, ',');
  for (const std::string& name : columns.covariates) {
    const auto found = row.covariates.find(name);
    absl::StrAppend(&line, ",", found == row.covariates.end() ? "" : ShortestNumber(found->second));
  }
  return line + "\n";
}

std::string FormatImagesCsv(const ImageSet& set) {
  const ImageColumns columns = ColumnsOf(set);
  std::string text = ImagesCsvHeader(columns);
  for (const PhotographRow& row : set.photographs)
    absl::StrAppend(&text, ImagesCsvRow(row, set.objects[row.object], columns));
  return text;
}

}  // namespace touchstone::session
