// The file of a bug report: a gzipped tar with a manifest first, which says how long every other file in it is and its
// SHA-256. A reader believes none of it: what comes from somebody else may be cut off, damaged or made to do harm.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

namespace touchstone::gateway::bundle {

// Of what is unpacked. One that is larger is not made, and not opened.
inline constexpr uint64_t kMaxBundleBytes = uint64_t{4} << 30;
inline constexpr size_t kMaxBundleFiles = 256;
inline constexpr uint64_t kMaxManifestBytes = 1 << 20;

// "session.db", "models/model-1.yaml": at most one folder, of letters, digits, '_', '-' and '.', which no part begins with.
bool IsBundleName(const std::string& name);

// A file on the disk, and its name in the bundle.
struct BundleMember {
  std::string name;
  std::string path;
};

// Makes the file at `path`, which must be free, and returns its manifest: `manifest` and "files", name, bytes and SHA-256 of each. Owner and times of
// the files are not in it. RESOURCE_EXHAUSTED beyond kMaxBundleBytes.
absl::StatusOr<nlohmann::ordered_json> WriteBundle(const std::string& path,
                                                   const nlohmann::ordered_json& manifest,
                                                   const std::vector<BundleMember>& members);

// A bundle whose every byte was checked, unpacked in a folder that only this user may enter, and which goes with the object.
class OpenedBundle {
 public:
  // INVALID_ARGUMENT or DATA_LOSS names the file, the member and what is wrong: no bundle, cut off, a name or kind of member
  // that no bundle has (a path outside, a link), a member that the manifest does not list or lists with another length or
  // hash, a member that is missing, too many or too much.
  static absl::StatusOr<std::unique_ptr<OpenedBundle>> Open(const std::string& path);
  ~OpenedBundle();
  OpenedBundle(const OpenedBundle&) = delete;
  OpenedBundle& operator=(const OpenedBundle&) = delete;

  const nlohmann::json& manifest() const { return manifest_; }
  // In the order of the manifest.
  const std::vector<std::string>& names() const { return names_; }
  bool Has(const std::string& name) const;
  // Where it lies, whether it is there or not.
  std::string PathOf(const std::string& name) const { return folder_ + "/" + name; }

 private:
  OpenedBundle() = default;
  std::string folder_;
  nlohmann::json manifest_;
  std::vector<std::string> names_;
};

// Whether a file begins as a gzipped one does: a journal does not.
bool LooksLikeBundle(const std::string& path);

}  // namespace touchstone::gateway::bundle
