#include "server/base/files/file_label.h"

#include <algorithm>
#include <filesystem>

namespace touchstone {
namespace {

std::string NameWithoutFolders(const std::string& path) {
  const std::string name = std::filesystem::path(path).filename().string();
  return name.empty() ? path : name;
}

}  // namespace

std::string FileLabel(const std::vector<std::string>& paths, size_t index) {
  const std::string name = NameWithoutFolders(paths[index]);
  const auto same = std::count_if(paths.begin(), paths.end(),
                                  [&](const std::string& path) { return NameWithoutFolders(path) == name; });
  return same > 1 ? paths[index] : name;
}

}  // namespace touchstone
