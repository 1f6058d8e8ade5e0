#include "server/model/provenance.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>

#include <algorithm>
#include <utility>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/model/yaml/yaml_text.h"

namespace touchstone::model {
namespace {

using Kind = YamlNode::Kind;

class ProvenanceReader {
 public:
  explicit ProvenanceReader(const std::string& origin) : origin_(origin) {}

  absl::StatusOr<Provenance> Read(const YamlNode& node) {
    TOUCHSTONE_RETURN_IF_ERROR(CheckMap(node, "provenance", {"over", "fitted_to", "promoted"}));
    Provenance provenance;
    if (const YamlNode* over = node.Find("over")) {
      TOUCHSTONE_RETURN_IF_ERROR(CheckMap(*over, "over", {"name", "hash"}));
      TOUCHSTONE_RETURN_IF_ERROR(ReadText(*over, "name", &provenance.over_name));
      TOUCHSTONE_RETURN_IF_ERROR(ReadText(*over, "hash", &provenance.over_hash));
    }
    if (const YamlNode* sets = node.Find("fitted_to")) {
      if (sets->kind != Kind::kSequence)
        return Error(*sets,
                     absl::StrCat("fitted_to is ", sets->KindInWords(), "; a list of sets was expected"));
      for (const YamlNode& set : sets->items) {
        TOUCHSTONE_RETURN_IF_ERROR(
            CheckMap(set, "a set", {"set", "sha256", "unit", "rmse_before", "rmse_after"}));
        TOUCHSTONE_RETURN_IF_ERROR(ReadSet(set, &provenance.fitted_to.emplace_back()));
      }
    }
    if (const YamlNode* promoted = node.Find("promoted")) {
      Promotion& promotion = provenance.promotion.emplace();
      TOUCHSTONE_RETURN_IF_ERROR(CheckMap(*promoted, "promoted",
                                          {"set", "sha256", "unit", "rmse_before", "rmse_after",
                                           "difference_lower", "difference_upper", "hash", "before"}));
      TOUCHSTONE_RETURN_IF_ERROR(ReadSet(*promoted, &promotion.on));
      TOUCHSTONE_RETURN_IF_ERROR(ReadNumber(*promoted, "difference_lower", &promotion.lower));
      TOUCHSTONE_RETURN_IF_ERROR(ReadNumber(*promoted, "difference_upper", &promotion.upper));
      TOUCHSTONE_RETURN_IF_ERROR(ReadText(*promoted, "hash", &promotion.hash));
      TOUCHSTONE_RETURN_IF_ERROR(ReadText(*promoted, "before", &promotion.before));
    }
    return provenance;
  }

 private:
  absl::Status Error(const YamlNode& node, absl::string_view message) const {
    return ErrorAt(origin_, node, message);
  }
  absl::Status CheckMap(const YamlNode& node, absl::string_view what,
                        const std::vector<std::string>& known) const {
    if (node.kind != Kind::kMap)
      return Error(node, absl::StrCat(what, " is ", node.KindInWords(), "; a map was expected"));
    for (const YamlNode& key : node.keys)
      if (std::find(known.begin(), known.end(), key.text) == known.end())
        return Error(key, absl::StrCat(what, " has no '", key.text, "'", DidYouMean(key.text, known)));
    return absl::OkStatus();
  }
  absl::Status ReadText(const YamlNode& map, const char* key, std::string* text) const {
    const YamlNode* node = map.Find(key);
    if (node == nullptr || node->kind == Kind::kNull) return absl::OkStatus();
    if (node->kind != Kind::kScalar)
      return Error(*node, absl::StrCat(key, " is ", node->KindInWords(), "; a text was expected"));
    *text = node->text;
    return absl::OkStatus();
  }
  absl::Status ReadNumber(const YamlNode& map, const char* key, double* number) const {
    const YamlNode* node = map.Find(key);
    if (node == nullptr) return absl::OkStatus();
    const absl::StatusOr<double> read = ParseNumber(node->text);
    if (!read.ok()) return Error(*node, absl::StrCat(key, ": ", read.status().message()));
    *number = *read;
    return absl::OkStatus();
  }
  absl::Status ReadSet(const YamlNode& map, UsedSet* set) const {
    TOUCHSTONE_RETURN_IF_ERROR(ReadText(map, "set", &set->set));
    TOUCHSTONE_RETURN_IF_ERROR(ReadText(map, "sha256", &set->sha256));
    TOUCHSTONE_RETURN_IF_ERROR(ReadText(map, "unit", &set->unit));
    TOUCHSTONE_RETURN_IF_ERROR(ReadNumber(map, "rmse_before", &set->rmse_before));
    return ReadNumber(map, "rmse_after", &set->rmse_after);
  }

  const std::string& origin_;
};

std::vector<std::string> SetFields(const UsedSet& set) {
  std::vector<std::string> fields = {absl::StrCat("set: ", YamlText(set.set))};
  if (!set.sha256.empty()) fields.push_back(absl::StrCat("sha256: ", YamlText(set.sha256)));
  if (set.unit.empty()) return fields;
  fields.push_back(absl::StrCat("unit: ", YamlText(set.unit)));
  fields.push_back(absl::StrCat("rmse_before: ", ShortestNumber(set.rmse_before)));
  fields.push_back(absl::StrCat("rmse_after: ", ShortestNumber(set.rmse_after)));
  return fields;
}

// Whether a text comes back byte for byte from a literal block: it begins with a mark, ends with one line end and has none but
// printable ASCII.
bool IsBlock(absl::string_view text) {
  return !text.empty() && text.front() > ' ' && absl::EndsWith(text, "\n") && !absl::EndsWith(text, "\n\n") &&
         std::all_of(text.begin(), text.end(), [](char c) { return c == '\n' || (c >= ' ' && c < 0x7f); });
}

}  // namespace

absl::StatusOr<Provenance> ProvenanceOf(const YamlNode& node, const std::string& origin) {
  return ProvenanceReader(origin).Read(node);
}

absl::StatusOr<Provenance> ReadProvenance(const std::string& yaml, const std::string& origin) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const YamlNode root, ParseYaml(yaml, origin));
  const YamlNode* node = root.Find("provenance");
  if (node == nullptr || node->kind == Kind::kNull) return Provenance();
  return ProvenanceOf(*node, origin);
}

std::string FormatProvenance(const Provenance& provenance) {
  if (provenance.empty()) return "";
  std::string text = "provenance:\n";
  if (!provenance.over_hash.empty())
    absl::StrAppend(&text, "  over: {name: ", YamlText(provenance.over_name),
                    ", hash: ", YamlText(provenance.over_hash), "}\n");
  if (!provenance.fitted_to.empty()) absl::StrAppend(&text, "  fitted_to:\n");
  for (const UsedSet& set : provenance.fitted_to)
    absl::StrAppend(&text, "    - {", absl::StrJoin(SetFields(set), ", "), "}\n");
  if (!provenance.promotion) return text;
  const Promotion& promotion = *provenance.promotion;
  absl::StrAppend(&text, "  promoted:\n");
  for (const std::string& field : SetFields(promotion.on)) absl::StrAppend(&text, "    ", field, "\n");
  absl::StrAppend(&text, "    difference_lower: ", ShortestNumber(promotion.lower),
                  "\n    difference_upper: ", ShortestNumber(promotion.upper), "\n");
  if (!promotion.hash.empty()) absl::StrAppend(&text, "    hash: ", YamlText(promotion.hash), "\n");
  if (promotion.before.empty()) return text;
  if (!IsBlock(promotion.before)) {
    absl::StrAppend(&text, "    before: ", QuotedYamlText(promotion.before), "\n");
    return text;
  }
  absl::StrAppend(&text, "    before: |\n");
  const absl::string_view lines = absl::StripSuffix(promotion.before, "\n");
  for (const absl::string_view line : absl::StrSplit(lines, '\n'))
    absl::StrAppend(&text, line.empty() ? "" : "      ", line, "\n");
  return text;
}

}  // namespace touchstone::model
