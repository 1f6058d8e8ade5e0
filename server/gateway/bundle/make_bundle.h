// A session of a rig as a bug report: what somebody else needs to see what its owner saw, and no name of theirs.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

namespace touchstone::gateway::bundle {

// Files that are read; empty: none.
struct BundleRequest {
  std::string journal;  // the SQLite file
  std::string session;
  std::string config;     // the gateway's TOML file
  std::string audit_log;  // what failed and was refused on the way, in order
  std::vector<std::string> models;
  struct Mesh {
    std::string object, path, options;  // "mug", "mug.stl", "unit=mm,up=z,scale=1"
  };
  std::vector<Mesh> meshes;
  bool pictures = true;
  std::optional<uint64_t> seed;   // of the emulator or of the plan, where somebody knows it
  std::vector<std::string> hide;  // further names that get an alias
  // What the gateway says of itself: {"rig": RigState, "state": State}, protocol messages as JSON; null: not asked.
  nlohmann::ordered_json state;
};

// Takes journal and audit log, unless they are named already, from the configuration, as a gateway does. An audit log that
// is not there is none. Does nothing without a configuration.
absl::Status TakeFilesOfConfig(BundleRequest* request);

// Writes it to a path that must be free, and returns its manifest. Errors name the file.
absl::StatusOr<nlohmann::ordered_json> MakeBundle(const BundleRequest& request, const std::string& path);

}  // namespace touchstone::gateway::bundle
