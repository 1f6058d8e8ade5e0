#include "server/model/yaml/yaml_tree.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <exception>
#include <sstream>
#include <unordered_set>

#include "server/base/text/text.h"
#include "server/base/text/utf16.h"

namespace touchstone::model {
namespace {

// Thrown through yaml-cpp's parser and caught in ParseYaml: the parser has no other way to be stopped.
struct Refused {
  YAML::Mark mark;
  std::string message;
};

class TreeBuilder : public YAML::EventHandler {
 public:
  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    Add(YamlNode::Kind::kNull, mark, "", anchor, "");
  }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override {
    throw Refused{mark, "aliases (*name) are not taken here; write the value out"};
  }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& value) override {
    Add(YamlNode::Kind::kScalar, mark, tag, anchor, value);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    Open(YamlNode::Kind::kSequence, mark, tag, anchor);
  }
  void OnSequenceEnd() override { Close(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    Open(YamlNode::Kind::kMap, mark, tag, anchor);
  }
  void OnMapEnd() override { Close(); }

  YamlNode TakeRoot() { return std::move(root_); }

 private:
  // A map or list under construction; in a map keys and values take turns.
  struct Level {
    YamlNode node;
    bool key_is_next = true;
    std::unordered_set<std::string> seen;
  };

  static YamlNode MakeNode(YamlNode::Kind kind, const YAML::Mark& mark) {
    YamlNode node;
    node.kind = kind;
    node.line = mark.line + 1;
    node.column = mark.column + 1;
    return node;
  }

  void Check(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor) {
    if (anchor != YAML::NullAnchor)
      throw Refused{mark, "anchors (&name) are not taken here; write the value out"};
    if (!tag.empty() && tag != "?" && tag != "!")
      throw Refused{mark, absl::StrCat("tags (", tag, ") are not taken here")};
    if (++nodes_ > kMaxYamlNodes)
      throw Refused{mark,
                    absl::StrCat("more than ", kMaxYamlNodes, " values and keys; nothing longer is read")};
  }

  void Add(YamlNode::Kind kind, const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
           const std::string& text) {
    Check(mark, tag, anchor);
    YamlNode node = MakeNode(kind, mark);
    node.text = text;
    Place(std::move(node), mark);
  }

  void Open(YamlNode::Kind kind, const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor) {
    Check(mark, tag, anchor);
    if (levels_.size() >= kMaxYamlDepth)
      throw Refused{mark, absl::StrCat("nested more than ", kMaxYamlDepth, " levels deep")};
    if (!levels_.empty() && levels_.back().node.kind == YamlNode::Kind::kMap && levels_.back().key_is_next)
      throw Refused{mark, "a key must be a name, not a list or a map"};
    levels_.emplace_back();
    levels_.back().node = MakeNode(kind, mark);
  }

  void Close() {
    YamlNode node = std::move(levels_.back().node);
    levels_.pop_back();
    Place(std::move(node), YAML::Mark::null_mark());
  }

  void Place(YamlNode node, const YAML::Mark& mark) {
    if (levels_.empty()) {
      root_ = std::move(node);
      return;
    }
    Level& level = levels_.back();
    if (level.node.kind == YamlNode::Kind::kSequence) {
      level.node.items.push_back(std::move(node));
      return;
    }
    if (level.key_is_next) {
      if (node.kind != YamlNode::Kind::kScalar) throw Refused{mark, "a key is missing before ':'"};
      if (!level.seen.insert(node.text).second)
        throw Refused{mark, absl::StrCat("'", node.text, "' is given twice; leave one out")};
      level.node.keys.push_back(std::move(node));
    } else {
      level.node.items.push_back(std::move(node));
    }
    level.key_is_next = !level.key_is_next;
  }

  std::vector<Level> levels_;
  YamlNode root_;
  int nodes_ = 0;
};

absl::Status ErrorAtMark(const std::string& origin, const YAML::Mark& mark, absl::string_view message) {
  YamlNode place;
  place.line = mark.is_null() ? 1 : mark.line + 1;
  place.column = mark.is_null() ? 1 : mark.column + 1;
  return ErrorAt(origin, place, message);
}

// The text with \n where lines end in \r alone, which the parser takes for a space. UTF-16, which it reads, stays.
std::string WithLineFeeds(const std::string& text) {
  if (!absl::StrContains(text, '\r') || IsUtf16(text)) return text;
  std::string with;
  for (absl::string_view rest = text, line; NextLine(&rest, &line);) absl::StrAppend(&with, line, "\n");
  return with;
}

// What is probably wrong, for the mistakes that people make most.
const char* HintFor(const YAML::Exception& error, const std::string& text) {
  if (absl::StrContains(error.msg, "end of map flow")) return "; is a '}' or a comma missing?";
  if (absl::StrContains(error.msg, "end of sequence flow")) return "; is a ']' or a comma missing?";
  const std::vector<absl::string_view> lines = absl::StrSplit(text, '\n');
  if (error.mark.line < 0 || error.mark.line >= static_cast<int>(lines.size())) return "";
  const absl::string_view line = lines[error.mark.line];
  const size_t indent = line.find_first_not_of(" \t");
  return absl::StrContains(line.substr(0, indent), "\t") ? "; lines are indented by spaces, not by tabs" : "";
}

}  // namespace

const YamlNode* YamlNode::Find(absl::string_view key) const {
  for (size_t i = 0; i < keys.size(); ++i)
    if (keys[i].text == key) return &items[i];
  return nullptr;
}

const char* YamlNode::KindInWords() const {
  switch (kind) {
    case Kind::kNull:
      return "nothing";
    case Kind::kScalar:
      return "a single value";
    case Kind::kSequence:
      return "a list";
    case Kind::kMap:
      return "a map";
  }
  return "";
}

absl::Status ErrorAt(const std::string& origin, const YamlNode& node, absl::string_view message) {
  return absl::InvalidArgumentError(absl::StrCat(origin, ":", node.line, ":", node.column, ": ", message));
}

absl::StatusOr<YamlNode> ParseYaml(const std::string& text, const std::string& origin) {
  if (text.size() > kMaxYamlBytes)
    return absl::InvalidArgumentError(
        absl::StrCat(origin, ": has ", text.size(), " bytes; at most ", kMaxYamlBytes, " are read"));
  try {
    std::istringstream stream(WithLineFeeds(text));
    YAML::Parser parser(stream);
    TreeBuilder builder;
    if (!parser.HandleNextDocument(builder))
      return absl::InvalidArgumentError(
          absl::StrCat(origin, ": is empty; a model file begins with 'touchstone: model/1'"));
    YamlNode root = builder.TakeRoot();
    TreeBuilder rest;
    if (parser.HandleNextDocument(rest))
      return ErrorAt(origin, rest.TakeRoot(), "a second document begins here; one file holds one");
    return root;
  } catch (const Refused& refused) {
    return ErrorAtMark(origin, refused.mark, refused.message);
  } catch (const YAML::Exception& error) {
    return ErrorAtMark(origin, error.mark, absl::StrCat("not valid YAML: ", error.msg, HintFor(error, text)));
  }
}

}  // namespace touchstone::model
