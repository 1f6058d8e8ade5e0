#include "server/service/options/server_options.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include <algorithm>
#include <filesystem>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/geometry/files/mesh_file.h"

namespace touchstone::service {
namespace {

absl::Status CheckName(const std::string& name, const std::string& text) {
  const bool plain = !name.empty() && name.size() <= 64 && std::all_of(name.begin(), name.end(), [](char c) {
    return absl::ascii_isalnum(c) || c == '_' || c == '.' || c == '-';
  });
  if (plain) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("mesh '", text, "': the name '", name,
                                                 "' must be 1 to 64 letters, digits, '_', '.' or '-'"));
}

}  // namespace

absl::StatusOr<source::MeshSpec> ParseMeshSpec(const std::string& text) {
  // FILE[,key=value...] behind NAME=; a comma in a path looks like a key, so it is refused by the key check.
  const std::vector<std::string> parts = absl::StrSplit(text, ',');
  const std::pair<std::string, std::string> head = absl::StrSplit(parts[0], absl::MaxSplits('=', 1));
  if (head.second.empty())
    return absl::InvalidArgumentError(
        absl::StrCat("mesh '", text, "': write NAME=FILE, for instance cup=cup.off,fit_mm=150,up=y"));
  source::MeshSpec source;
  source.name = head.first;
  source.path = head.second;
  TOUCHSTONE_RETURN_IF_ERROR(CheckName(source.name, text));
  for (size_t k = 1; k < parts.size(); ++k) {
    const std::pair<std::string, std::string> option = absl::StrSplit(parts[k], absl::MaxSplits('=', 1));
    if (option.first == "unit" || option.first == "up") {
      (option.first == "unit" ? source.unit : source.up) = option.second;
    } else if (option.first == "scale" || option.first == "fit_mm") {
      const auto value = ParseNumber(option.second);
      if (!value.ok() || *value <= 0)
        return absl::InvalidArgumentError(absl::StrCat("mesh '", text, "': ", option.first, " = '",
                                                       option.second, "' must be a number above 0"));
      (option.first == "scale" ? source.scale : source.fit_mm) = *value;
    } else {
      return absl::InvalidArgumentError(
          absl::StrCat("mesh '", text, "': '", option.first, "' is no option",
                       DidYouMean(option.first, {"unit", "up", "scale", "fit_mm"})));
    }
  }
  return source;
}

absl::StatusOr<std::vector<source::MeshSpec>> MeshSpecsOfFolder(const std::string& folder) {
  std::error_code error;
  std::vector<source::MeshSpec> sources;
  const std::vector<std::string> formats = geometry::MeshFormatNames();
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string extension = entry.path().extension().string();
    const std::string format = extension.empty() ? "" : absl::AsciiStrToLower(extension.substr(1));
    if (std::find(formats.begin(), formats.end(), format) == formats.end()) continue;
    source::MeshSpec source;
    source.name = entry.path().stem().string();
    source.path = entry.path().string();
    TOUCHSTONE_RETURN_IF_ERROR(CheckName(source.name, source.path));
    sources.push_back(source);
  }
  if (error) return absl::InvalidArgumentError(absl::StrCat("mesh_dir '", folder, "': ", error.message()));
  // The same shape in two formats is one object: the first by name of the file.
  std::sort(sources.begin(), sources.end(),
            [](const source::MeshSpec& a, const source::MeshSpec& b) { return a.path < b.path; });
  for (size_t k = 1; k < sources.size(); ++k)
    if (sources[k].name == sources[k - 1].name)
      return absl::InvalidArgumentError(absl::StrCat("mesh_dir '", folder, "': ", sources[k - 1].path,
                                                     " and ", sources[k].path, " would share the name '",
                                                     sources[k].name, "': keep one of them there"));
  return sources;
}

}  // namespace touchstone::service
