#include "server/base/process/memory_limit.h"

#include <absl/strings/match.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <map>
#include <vector>

namespace touchstone {
namespace {

constexpr uint64_t kNoLimit = std::numeric_limits<uint64_t>::max();

// The two kinds of hierarchies that can limit memory, by the type of their file system.
struct Hierarchy {
  const char* type;
  std::vector<const char*> limits;  // files of a group; "max" and what cannot be read is no limit
};
const Hierarchy kHierarchies[] = {
    // Beyond memory.high a group is not ended, but held up until it stands still.
    {"cgroup2", {"memory.max", "memory.high"}},
    {"cgroup", {"memory.limit_in_bytes"}},
};

bool Names(absl::string_view list, absl::string_view controller) {
  const std::vector<absl::string_view> controllers = absl::StrSplit(list, ',');
  return std::find(controllers.begin(), controllers.end(), controller) != controllers.end();
}

// "\040" is a blank, as mountinfo writes it.
std::string Unescaped(absl::string_view text) {
  const auto octal = [](char c) { return c >= '0' && c <= '7'; };
  std::string plain;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '\\' && i + 3 < text.size() && octal(text[i + 1]) && octal(text[i + 2]) &&
        octal(text[i + 3])) {
      plain += static_cast<char>((text[i + 1] - '0') * 64 + (text[i + 2] - '0') * 8 + (text[i + 3] - '0'));
      i += 3;
    } else {
      plain += text[i];
    }
  }
  return plain;
}

// The group of this process by type of hierarchy, "/system.slice/touchstone.service".
std::map<std::string, std::string> OwnGroups(const std::string& root) {
  std::map<std::string, std::string> groups;
  std::ifstream file(root + "/proc/self/cgroup");
  for (std::string line; std::getline(file, line);) {
    const std::vector<std::string> parts = absl::StrSplit(line, absl::MaxSplits(':', 2));
    if (parts.size() != 3) continue;
    if (parts[0] == "0" && parts[1].empty()) groups["cgroup2"] = parts[2];
    if (Names(parts[1], "memory")) groups["cgroup"] = parts[2];
  }
  return groups;
}

// Where a hierarchy is mounted, and which group stands there.
struct Mount {
  std::string type, group, folder;
};

std::vector<Mount> MemoryMounts(const std::string& root) {
  std::vector<Mount> mounts;
  std::ifstream file(root + "/proc/self/mountinfo");
  for (std::string line; std::getline(file, line);) {
    const std::vector<std::string> halves = absl::StrSplit(line, absl::MaxSplits(" - ", 1));
    if (halves.size() != 2) continue;
    const std::vector<std::string> mount = absl::StrSplit(halves[0], ' ');
    const std::vector<std::string> system = absl::StrSplit(halves[1], ' ');
    if (mount.size() < 6 || system.size() < 3) continue;
    if (system[0] == "cgroup2" || (system[0] == "cgroup" && Names(system[2], "memory")))
      mounts.push_back({system[0], Unescaped(mount[3]), Unescaped(mount[4])});
  }
  return mounts;
}

// `group` below the group that is mounted: "" or "/a/b". A group that the mount does not show, as in a container that was
// given the mount of its own group alone or by another name, is taken for the mounted one.
std::string Below(const std::string& mounted, const std::string& group) {
  absl::string_view rest = group;
  if (mounted != "/" && !absl::ConsumePrefix(&rest, mounted)) return "";
  if (rest == "/" || (!rest.empty() && rest[0] != '/') || absl::StrContains(rest, "/..")) return "";
  return std::string(rest);
}

uint64_t LimitIn(const std::string& folder, const Hierarchy& hierarchy) {
  uint64_t smallest = kNoLimit;
  for (const char* name : hierarchy.limits) {
    uint64_t limit = 0;
    if (std::ifstream(folder + "/" + name) >> limit && limit > 0) smallest = std::min(smallest, limit);
  }
  return smallest;
}

}  // namespace

uint64_t CgroupMemoryBytes(const std::string& root) {
  const std::map<std::string, std::string> groups = OwnGroups(root);
  uint64_t smallest = kNoLimit;
  for (const Mount& mount : MemoryMounts(root)) {
    const auto group = groups.find(mount.type);
    if (group == groups.end()) continue;
    const Hierarchy& hierarchy =
        *std::find_if(std::begin(kHierarchies), std::end(kHierarchies),
                      [&](const Hierarchy& each) { return mount.type == each.type; });
    // The group of this process, then each around it up to the one that is mounted.
    const std::string top = root + mount.folder;
    for (std::string folder = Below(mount.group, group->second);; folder.resize(folder.rfind('/'))) {
      smallest = std::min(smallest, LimitIn(top + folder, hierarchy));
      if (folder.empty()) break;
    }
  }
  return smallest;
}

uint64_t MemoryLimitBytes() {
  const uint64_t machine =
      static_cast<uint64_t>(::sysconf(_SC_PHYS_PAGES)) * static_cast<uint64_t>(::sysconf(_SC_PAGESIZE));
  return std::min(machine, CgroupMemoryBytes());
}

}  // namespace touchstone
