// The objects that a source touches, by name.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/base/threads/thread_pool.h"
#include "server/geometry/surface/surface.h"

namespace touchstone::source {

// A mesh file to serve under a name, with what the file does not say.
struct MeshSpec {
  std::string name;  // [A-Za-z0-9_.-]{1,64}
  std::string path;
  std::string unit = "mm";  // "mm", "cm", "m", "inch"
  std::string up = "z";     // which axis of the file points up: "x", "y", "z"
  double scale = 1;         // further factor on the coordinates
  double fit_mm = 0;        // > 0: scale so that the longest side of the bounding box is this long
};

struct ServedObject {
  std::shared_ptr<const geometry::Surface> surface;
  bool closed = false;
  std::string origin;  // "built-in supershape", or the file's name
};

// Fixed once loaded, so that every thread may read it.
class ObjectStore {
 public:
  // The built-in supershapes, each of about that many triangles, and the given files, read in parallel. Errors name
  // the file. A file may take the place of a built-in shape, but two files may not share a name.
  static absl::StatusOr<ObjectStore> Load(const std::vector<MeshSpec>& meshes, int supershape_triangles,
                                          ThreadPool* pool);
  const std::map<std::string, ServedObject>& all() const { return objects_; }
  // NOT_FOUND names `field` and suggests near names.
  absl::StatusOr<const ServedObject*> Find(const std::string& name, const std::string& field) const;

 private:
  std::map<std::string, ServedObject> objects_;
};

}  // namespace touchstone::source
