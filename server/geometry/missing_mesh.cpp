#include "server/geometry/missing_mesh.h"

#include <algorithm>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "server/base/text/text.h"

namespace touchstone::geometry {
namespace {

constexpr size_t kMaxNamed = 5;  // objects in a message

}  // namespace

absl::Status MissingMesh(absl::string_view place, const std::vector<std::string>& missing,
                         const std::vector<std::string>& known) {
  const std::string others =
      missing.size() == 1
          ? ""
          : absl::StrCat(" (nor have ", missing.size() - 1, " others: ",
                         absl::StrJoin(missing.begin() + 1,
                                       missing.begin() + std::min(missing.size(), kMaxNamed), ", "),
                         missing.size() > kMaxNamed ? ", ..." : "", ")");
  return absl::NotFoundError(absl::StrCat(place, "'", missing[0], "' has no mesh", others,
                                          "; give it with --mesh ", missing[0], "=FILE or --mesh-dir FOLDER",
                                          DidYouMean(missing[0], known)));
}

}  // namespace touchstone::geometry
