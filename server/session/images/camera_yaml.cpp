#include "server/session/images/camera_yaml.h"

#include <absl/strings/str_cat.h>

#include <cmath>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/image/image.h"
#include "server/model/yaml/yaml_tree.h"
#include "server/session/csv/csv_fields.h"

namespace touchstone::session {
namespace {

constexpr double kMaxFocalPx = 1e6;
constexpr double kMaxPrincipalPx = 1e5;  // a cut-out may lie far from the axis
constexpr double kMaxDistortion = 1e3;

constexpr char kExpected[] =
    "{width_px: .., height_px: .., fx_px: .., fy_px: .., cx_px: .., cy_px: ..} was expected, and k1, k2, p1, "
    "p2, k3 "
    "where the nominal lens has them";

enum class Need { kSide, kFocal, kPrincipal, kDistortion };

struct CameraKey {
  const char* name;
  Need need;
  double CameraIntrinsics::*number;  // null: one of the sides
  int CameraIntrinsics::*side;
};

constexpr CameraKey kKeys[] = {
    {"width_px", Need::kSide, nullptr, &CameraIntrinsics::width_px},
    {"height_px", Need::kSide, nullptr, &CameraIntrinsics::height_px},
    {"fx_px", Need::kFocal, &CameraIntrinsics::fx_px, nullptr},
    {"fy_px", Need::kFocal, &CameraIntrinsics::fy_px, nullptr},
    {"cx_px", Need::kPrincipal, &CameraIntrinsics::cx_px, nullptr},
    {"cy_px", Need::kPrincipal, &CameraIntrinsics::cy_px, nullptr},
    {"k1", Need::kDistortion, &CameraIntrinsics::k1, nullptr},
    {"k2", Need::kDistortion, &CameraIntrinsics::k2, nullptr},
    {"p1", Need::kDistortion, &CameraIntrinsics::p1, nullptr},
    {"p2", Need::kDistortion, &CameraIntrinsics::p2, nullptr},
    {"k3", Need::kDistortion, &CameraIntrinsics::k3, nullptr},
};

const CameraKey* KeyNamed(const std::string& name) {
  for (const CameraKey& key : kKeys)
    if (name == key.name) return &key;
  return nullptr;
}

// Why a number does not do; empty: it does.
std::string WrongNumber(Need need, double value) {
  switch (need) {
    case Need::kSide:
      if (value >= 1 && value <= image::kMaxImageSide && value == std::floor(value)) return "";
      return absl::StrCat("a whole number of pixels from 1 to ", image::kMaxImageSide, " was expected");
    case Need::kFocal:
      if (value > 0 && value <= kMaxFocalPx) return "";
      return absl::StrCat("a focal length above 0 and at most ", kMaxFocalPx, " pixels was expected");
    case Need::kPrincipal:
      if (std::abs(value) <= kMaxPrincipalPx) return "";
      return absl::StrCat("a place within ", kMaxPrincipalPx,
                          " pixels of the picture's upper left corner was expected");
    case Need::kDistortion:
      if (std::abs(value) <= kMaxDistortion) return "";
      return absl::StrCat("a coefficient from -", kMaxDistortion, " to ", kMaxDistortion, " was expected");
  }
  return "";
}

absl::Status ReadCameraNumber(const model::YamlNode& key, const model::YamlNode& value,
                              const std::string& origin, CameraIntrinsics* camera) {
  const CameraKey* known = KeyNamed(key.text);
  if (known == nullptr)
    return model::ErrorAt(
        origin, key,
        absl::StrCat("'", Shown(key.text), "' is nothing that a camera.yaml holds; ", kExpected));
  if (value.kind != model::YamlNode::Kind::kScalar)
    return model::ErrorAt(origin, value,
                          absl::StrCat(key.text, " is ", value.KindInWords(), "; a number was expected"));
  const absl::StatusOr<double> number = FieldNumber(value.text);
  if (!number.ok())
    return model::ErrorAt(origin, value, absl::StrCat(key.text, ": ", number.status().message()));
  if (const std::string wrong = WrongNumber(known->need, *number); !wrong.empty())
    return model::ErrorAt(origin, value, absl::StrCat(key.text, " is ", Shown(value.text), "; ", wrong));
  if (known->side != nullptr)
    camera->*known->side = static_cast<int>(*number);
  else
    camera->*known->number = *number;
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<CameraIntrinsics> ParseCameraYaml(const std::string& text, const std::string& origin) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const model::YamlNode root, model::ParseYaml(text, origin));
  if (root.kind != model::YamlNode::Kind::kMap)
    return model::ErrorAt(origin, root, absl::StrCat("is ", root.KindInWords(), "; ", kExpected));
  CameraIntrinsics camera;
  for (size_t k = 0; k < root.keys.size(); ++k)
    TOUCHSTONE_RETURN_IF_ERROR(ReadCameraNumber(root.keys[k], root.items[k], origin, &camera));
  for (const CameraKey& key : kKeys)
    if (key.need != Need::kDistortion && root.Find(key.name) == nullptr)
      return model::ErrorAt(origin, root, absl::StrCat(key.name, " is missing; ", kExpected));
  return camera;
}

std::string FormatCameraYaml(const CameraIntrinsics& camera) {
  std::string text;
  for (const CameraKey& key : kKeys) {
    if (key.need == Need::kDistortion && camera.*key.number == 0) continue;
    absl::StrAppend(
        &text, text.empty() ? "{" : ", ", key.name, ": ",
        key.side != nullptr ? absl::StrCat(camera.*key.side) : ShortestNumber(camera.*key.number));
  }
  return text + "}\n";
}

}  // namespace touchstone::session
