// Reads and writes the calibration file.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/text/printable.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/gateway/calibration/calibration.h"
#include "server/geometry/pose.h"
#include "server/model/yaml/yaml_tree.h"

namespace touchstone::gateway::calibration {
namespace {

using Kind = model::YamlNode::Kind;

constexpr char kFormat[] = "calibration/1";
constexpr double kFarthestMm = 10'000;
constexpr double kMaxTurnDeg = 360;
constexpr char kPoseExample[] = "{translation_mm: [0, 0, 120], rotation_deg: [0, 0, 0]}";

class CalibrationReader {
 public:
  explicit CalibrationReader(const std::string& origin) : origin_(origin) {}

  absl::StatusOr<Calibration> Read(const model::YamlNode& root) {
    TOUCHSTONE_RETURN_IF_ERROR(
        Want(root, Kind::kMap, "a calibration file",
             "touchstone: calibration/1, flange_from_tip: ..., base_from_object: ..."));
    TOUCHSTONE_RETURN_IF_ERROR(
        CheckKeys(root, "a calibration file",
                  {"touchstone", "flange_from_tip", "flange_from_camera", "base_from_object", "made"}));
    const model::YamlNode* format = root.Find("touchstone");
    if (format == nullptr)
      return Error(root,
                   "the first line 'touchstone: calibration/1' is missing: is this a calibration file?");
    if (format->text != kFormat)
      return Error(*format,
                   absl::StrCat("touchstone is '", format->text, "'; this program reads '", kFormat, "'"));
    // A rig without it would move its flange to where its tip belongs.
    const model::YamlNode* tip = root.Find("flange_from_tip");
    if (tip == nullptr)
      return Error(root, absl::StrCat("'flange_from_tip' is missing; write for example 'flange_from_tip: ",
                                      kPoseExample, "'"));
    TOUCHSTONE_ASSIGN_OR_RETURN(calibration_.flange_from_tip, Pose(*tip, "flange_from_tip"));
    if (const model::YamlNode* camera = root.Find("flange_from_camera"); camera != nullptr) {
      TOUCHSTONE_ASSIGN_OR_RETURN(calibration_.flange_from_camera, Pose(*camera, "flange_from_camera"));
      calibration_.has_camera = true;
    }
    TOUCHSTONE_RETURN_IF_ERROR(ReadObjects(root.Find("base_from_object")));
    TOUCHSTONE_RETURN_IF_ERROR(ReadNotes(root.Find("made")));
    return std::move(calibration_);
  }

 private:
  absl::Status ReadObjects(const model::YamlNode* objects) {
    if (objects == nullptr || objects->kind == Kind::kNull) return absl::OkStatus();
    TOUCHSTONE_RETURN_IF_ERROR(Want(*objects, Kind::kMap, "base_from_object",
                                    absl::StrCat("one 'object: ", kPoseExample, "' a line")));
    for (size_t i = 0; i < objects->items.size(); ++i) {
      const std::string& name = objects->keys[i].text;
      TOUCHSTONE_RETURN_IF_ERROR(CheckName(objects->keys[i], "base_from_object"));
      TOUCHSTONE_ASSIGN_OR_RETURN(calibration_.base_from_object[name],
                                  Pose(objects->items[i], absl::StrCat("base_from_object.", name)));
    }
    return absl::OkStatus();
  }

  // YAML itself takes a key of 1,024 characters at most: a longer one could be read as another kind of key, but not be
  // written again.
  absl::Status CheckName(const model::YamlNode& key, absl::string_view where) const {
    constexpr size_t kMaxNameBytes = 256;
    if (!key.text.empty() && key.text.size() <= kMaxNameBytes) return absl::OkStatus();
    return Error(key, absl::StrCat(where, ": '", Printable(key.text, 60), "' has ", key.text.size(),
                                   " bytes; a name has 1 to ", kMaxNameBytes));
  }

  // For people: any text, and lists of texts by name one level down.
  absl::Status ReadNotes(const model::YamlNode* made) {
    if (made == nullptr || made->kind == Kind::kNull) return absl::OkStatus();
    TOUCHSTONE_RETURN_IF_ERROR(
        Want(*made, Kind::kMap, "made", "{date: 2026-01-31, how: \"...\", rms_mm: {lat20: 0.02}}"));
    for (size_t i = 0; i < made->items.size(); ++i) {
      const std::string& key = made->keys[i].text;
      const model::YamlNode& item = made->items[i];
      TOUCHSTONE_RETURN_IF_ERROR(CheckName(made->keys[i], "made"));
      if (key.find(' ') != std::string::npos)
        return Error(made->keys[i], absl::StrCat("made: '", key, "' is no name; one without spaces is"));
      if (item.kind == Kind::kMap) {
        for (size_t k = 0; k < item.items.size(); ++k) {
          TOUCHSTONE_RETURN_IF_ERROR(CheckName(item.keys[k], absl::StrCat("made.", key)));
          const std::string what = absl::StrCat("made.", key, ".", item.keys[k].text);
          TOUCHSTONE_RETURN_IF_ERROR(Want(item.items[k], Kind::kScalar, what, "a number or text"));
          calibration_.notes[absl::StrCat(key, " ", item.keys[k].text)] = item.items[k].text;
        }
        continue;
      }
      TOUCHSTONE_RETURN_IF_ERROR(Want(item, Kind::kScalar, absl::StrCat("made.", key), "a number or text"));
      calibration_.notes[key] = item.text;
    }
    return absl::OkStatus();
  }

  absl::StatusOr<Eigen::Isometry3d> Pose(const model::YamlNode& node, const std::string& what) const {
    TOUCHSTONE_RETURN_IF_ERROR(Want(node, Kind::kMap, what, kPoseExample));
    TOUCHSTONE_RETURN_IF_ERROR(CheckKeys(node, what, {"translation_mm", "rotation_deg"}));
    TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::Vector3d translation_mm,
                                Vector(node, "translation_mm", what, kFarthestMm));
    TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::Vector3d rotation_deg,
                                Vector(node, "rotation_deg", what, kMaxTurnDeg));
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = translation_mm * kMetresPerMillimetre;
    pose.linear() = geometry::RotationFromVector(rotation_deg * kRadiansPerDegree);
    return pose;
  }

  // Three numbers, each between -largest and largest.
  absl::StatusOr<Eigen::Vector3d> Vector(const model::YamlNode& pose, const std::string& key,
                                         const std::string& what, double largest) const {
    const model::YamlNode* node = pose.Find(key);
    if (node == nullptr)
      return Error(pose, absl::StrCat(what, ": '", key, "' is missing; write for example ", kPoseExample));
    const std::string name = absl::StrCat(what, ".", key);
    TOUCHSTONE_RETURN_IF_ERROR(Want(*node, Kind::kSequence, name, "[0, 0, 120]"));
    if (node->items.size() != 3)
      return Error(*node, absl::StrCat(name, " has ", node->items.size(), " numbers; x, y and z are 3"));
    Eigen::Vector3d vector;
    for (int i = 0; i < 3; ++i) {
      const model::YamlNode& item = node->items[i];
      TOUCHSTONE_RETURN_IF_ERROR(Want(item, Kind::kScalar, name, "three numbers"));
      const absl::StatusOr<double> number = ParseNumber(item.text);
      if (!number.ok()) return Error(item, absl::StrCat(name, ": ", number.status().message()));
      if (!(std::abs(*number) <= largest))
        return Error(item,
                     absl::StrCat(name, ": ", ShortestNumber(*number), " is out of range; -",
                                  ShortestNumber(largest), " to ", ShortestNumber(largest), " is possible"));
      vector[i] = *number;
    }
    return vector;
  }

  absl::Status Error(const model::YamlNode& node, absl::string_view message) const {
    return model::ErrorAt(origin_, node, message);
  }

  absl::Status Want(const model::YamlNode& node, Kind kind, absl::string_view what,
                    absl::string_view example) const {
    if (node.kind == kind) return absl::OkStatus();
    model::YamlNode wanted;
    wanted.kind = kind;
    return Error(node, absl::StrCat(what, " is ", node.KindInWords(), "; it must be ", wanted.KindInWords(),
                                    ": ", example));
  }

  absl::Status CheckKeys(const model::YamlNode& map, absl::string_view what,
                         const std::vector<std::string>& known) const {
    for (const model::YamlNode& key : map.keys)
      if (std::find(known.begin(), known.end(), key.text) == known.end())
        return Error(key, absl::StrCat(what, " has no '", key.text, "'", DidYouMean(key.text, known)));
    return absl::OkStatus();
  }

  const std::string& origin_;
  Calibration calibration_;
};

// In double quotes, with what YAML would take apart escaped.
std::string Quoted(const std::string& text) {
  static const char kHex[] = "0123456789abcdef";
  std::string quoted = "\"";
  for (const unsigned char c : text) {
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += static_cast<char>(c);
    } else if (c < 0x20 || c == 0x7F) {
      quoted += {'\\', 'x', kHex[c >> 4], kHex[c & 15]};
    } else {
      quoted += static_cast<char>(c);
    }
  }
  return quoted + "\"";
}

// Rounded to 1 / per_unit.
std::string Numbers(const Eigen::Vector3d& values, double per_unit) {
  std::vector<std::string> numbers;
  for (const double value : values)
    numbers.push_back(ShortestNumber(std::round(value * per_unit) / per_unit + 0.0));
  return absl::StrCat("[", absl::StrJoin(numbers, ", "), "]");
}

// Rounded to 1 nm and 1e-9 deg, so that what a person wrote comes back as it was.
std::string PoseText(const Eigen::Isometry3d& pose) {
  return absl::StrCat(
      "{translation_mm: ", Numbers(pose.translation() / kMetresPerMillimetre, 1e6),
      ", rotation_deg: ", Numbers(geometry::RotationVectorOf(pose.linear()) / kRadiansPerDegree, 1e9), "}");
}

}  // namespace

absl::StatusOr<Calibration> ParseCalibration(const std::string& text, const std::string& origin) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const model::YamlNode root, model::ParseYaml(text, origin));
  return CalibrationReader(origin).Read(root);
}

absl::StatusOr<Calibration> ReadCalibration(const std::string& path) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(path, model::kMaxYamlBytes));
  return ParseCalibration(text, path);
}

std::string FormatCalibration(const Calibration& calibration) {
  std::string text = absl::StrCat("touchstone: ", kFormat,
                                  "\nflange_from_tip: ", PoseText(calibration.flange_from_tip), "\n");
  if (calibration.has_camera)
    absl::StrAppend(&text, "flange_from_camera: ", PoseText(calibration.flange_from_camera), "\n");
  if (!calibration.base_from_object.empty()) {
    absl::StrAppend(&text, "base_from_object:\n");
    for (const auto& [name, pose] : calibration.base_from_object)
      absl::StrAppend(&text, "  ", Quoted(name), ": ", PoseText(pose), "\n");
  }
  if (calibration.notes.empty()) return text;
  absl::StrAppend(&text, "made:\n");
  std::string group;
  for (const auto& [key, note] : calibration.notes) {
    const size_t space = key.find(' ');
    if (space == std::string::npos) {
      absl::StrAppend(&text, "  ", Quoted(key), ": ", Quoted(note), "\n");
      continue;
    }
    if (group != key.substr(0, space)) {
      group = key.substr(0, space);
      absl::StrAppend(&text, "  ", Quoted(group), ":\n");
    }
    absl::StrAppend(&text, "    ", Quoted(key.substr(space + 1)), ": ", Quoted(note), "\n");
  }
  return text;
}

}  // namespace touchstone::gateway::calibration
