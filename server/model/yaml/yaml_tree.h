// A YAML text as a small tree that remembers where everything stood. Stricter than YAML: no anchors, aliases
// or tags, no repeated keys, one document, and limits on size, depth and number of nodes, all enforced while
// reading, so that no input can eat memory.
#pragma once

#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

namespace touchstone::model {

struct YamlNode {
  enum class Kind { kNull, kScalar, kSequence, kMap };
  Kind kind = Kind::kNull;
  int line = 1;                 // from 1
  int column = 1;               // from 1
  std::string text;             // of a scalar
  std::vector<YamlNode> keys;   // of a map: scalars, one an item
  std::vector<YamlNode> items;  // of a sequence or map

  // The value of a key of a map; null if it is not there.
  const YamlNode* Find(absl::string_view key) const;
  // "a list", "a number or text", ...: for messages.
  const char* KindInWords() const;
};

inline constexpr size_t kMaxYamlBytes = 1 << 20;
inline constexpr int kMaxYamlDepth = 16;
inline constexpr int kMaxYamlNodes = 100'000;

// Errors begin with "origin:line:column: ".
absl::StatusOr<YamlNode> ParseYaml(const std::string& text, const std::string& origin);

// An error at a node.
absl::Status ErrorAt(const std::string& origin, const YamlNode& node, absl::string_view message);

}  // namespace touchstone::model
