#include "server/session/images/image_columns.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <map>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/session/csv/csv_fields.h"
#include "server/session/measurements/measurement_columns.h"

namespace touchstone::session {

const char* const kPlacementNames[kPlacementParts] = {
    "eye_x_mm", "eye_y_mm", "eye_z_mm", "at_x_mm", "at_y_mm", "at_z_mm", "up_x", "up_y", "up_z"};

namespace {

constexpr std::pair<const char*, ImageColumnKind> kSingleColumns[] = {
    {"image", ImageColumnKind::kImage},   {"file", ImageColumnKind::kFile},
    {"object", ImageColumnKind::kObject}, {"session_time_s", ImageColumnKind::kSessionTime},
    {"round", ImageColumnKind::kRound},   {"touch", ImageColumnKind::kTouch}};

std::vector<std::string> KnownImageColumns() {
  std::vector<std::string> names;
  for (const auto& [name, kind] : kSingleColumns) names.push_back(name);
  for (const char* part : kPlacementNames) {
    names.push_back(part);
    names.push_back(absl::StrCat(kMeasuredPrefix, part));
  }
  return names;
}

bool ImageColumnOf(const std::string& name, ImageColumn* column) {
  column->name = name;
  for (const auto& [single, kind] : kSingleColumns)
    if (name == single) {
      column->kind = kind;
      return true;
    }
  for (int part = 0; part < kPlacementParts; ++part) {
    column->index = part;
    column->kind = ImageColumnKind::kCommanded;
    if (name == kPlacementNames[part]) return true;
    column->kind = ImageColumnKind::kMeasured;
    if (name == absl::StrCat(kMeasuredPrefix, kPlacementNames[part])) return true;
  }
  column->kind = ImageColumnKind::kCovariate;
  column->index = 0;
  return IsCovariateName(name);
}

absl::Status WrongImageColumn(const std::vector<std::string>& names, size_t i, const std::string& line) {
  const std::string& name = names[i];
  const std::string place = absl::StrCat(line, "column ", i + 1, " '", Shown(name), "' ");
  if (name.empty())
    return absl::InvalidArgumentError(
        absl::StrCat(place, "has no name; is there a comma too many in the header?"));
  if (absl::StartsWith(name, "cov_"))
    return absl::InvalidArgumentError(
        absl::StrCat(place, "is no name of a covariate: letters, digits and '_' were expected after cov_"));
  return absl::InvalidArgumentError(absl::StrCat(place, "is no column of an image set",
                                                 DidYouMean(name, KnownImageColumns()),
                                                 " (further numbers have names that begin with cov_)"));
}

// A row must say which picture shows what, from where; a measured pose is whole.
absl::Status CheckImageColumns(const std::map<std::string, size_t>& seen, const std::string& line) {
  const auto missing = [&](const std::string& name, const char* why) {
    return absl::InvalidArgumentError(absl::StrCat(line, "column '", name, "' is missing", why));
  };
  for (const char* name : {"image", "file", "object"})
    if (seen.count(name) == 0)
      return missing(name, "; the first line must be the header (image,file,object,eye_x_mm,...)");
  for (const char* part : kPlacementNames)
    if (seen.count(part) == 0) return missing(part, "; a photograph needs eye, at and up");
  int measured = 0;
  for (const char* part : kPlacementNames)
    measured += static_cast<int>(seen.count(absl::StrCat(kMeasuredPrefix, part)));
  for (const char* part : kPlacementNames)
    if (const std::string name = absl::StrCat(kMeasuredPrefix, part); measured > 0 && seen.count(name) == 0)
      return missing(name, "; a measured pose has all nine columns or none");
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<ImageColumn>> ReadImageColumns(const std::vector<std::string>& names,
                                                          const std::string& origin) {
  const std::string line = absl::StrCat(origin, ":1: ");
  std::vector<ImageColumn> columns(names.size());
  std::map<std::string, size_t> seen;
  for (size_t i = 0; i < names.size(); ++i) {
    const auto [at, first] = seen.emplace(names[i], i + 1);
    if (!first)
      return absl::InvalidArgumentError(absl::StrCat(line, "column ", i + 1, " '", Shown(names[i]),
                                                     "' stands twice in the header, first as column ",
                                                     at->second));
    if (!ImageColumnOf(names[i], &columns[i])) return WrongImageColumn(names, i, line);
  }
  TOUCHSTONE_RETURN_IF_ERROR(CheckImageColumns(seen, line));
  return columns;
}

}  // namespace touchstone::session
