// Where a model file comes from: what its values were fitted to, and on what data it was promoted over another model. It
// stands in the file and describes that very model; a model that is changed is written without it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/model/yaml/yaml_tree.h"

namespace touchstone::model {

// A measurement set, and the errors of the model before and of this one on it.
struct UsedSet {
  std::string set;     // its path or name
  std::string sha256;  // hex, of what was measured, whatever file it stood in; empty: unknown
  std::string unit;    // of the errors: "us", "grey" or "px"
  double rmse_before = 0, rmse_after = 0;
};

struct Promotion {
  UsedSet on;
  double lower = 0, upper = 0;  // 95 % interval of the difference of the errors, after less before
  std::string before;           // the text of the model file that this one took the place of, whole
  std::string hash = {};  // of the model that was promoted: another one was changed since; empty: unknown
};

struct Provenance {
  std::string over_name, over_hash;  // of the model before; empty: unknown
  std::vector<UsedSet> fitted_to;
  std::optional<Promotion> promotion;

  bool empty() const { return over_hash.empty() && fitted_to.empty() && !promotion; }
};

// Of the text of a model file; empty where it says nothing. Errors name `origin`, line and column.
absl::StatusOr<Provenance> ReadProvenance(const std::string& yaml, const std::string& origin);
// Of a node `provenance`.
absl::StatusOr<Provenance> ProvenanceOf(const YamlNode& node, const std::string& origin);

// What stands in the file, to be appended to it; empty for an empty one.
std::string FormatProvenance(const Provenance& provenance);

}  // namespace touchstone::model
