#include "server/service/core/convert.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/base/text/printable.h"
#include "server/service/core/sent_model.h"
#include "server/session/journal/command_bytes.h"

namespace touchstone::service {

// Printable cuts about there, and adds dots: 2 KiB at most in all.
constexpr size_t kMaxMessageBytes = 2048 - 8;

grpc::Status ToGrpc(const absl::Status& status) {
  // The two enumerations share their numbers. A message that repeats what a client sent may not be longer than what
  // clients take as metadata (8 KB by default, with everything escaped), or they would see another error instead of it.
  return grpc::Status(static_cast<grpc::StatusCode>(status.code()),
                      Printable(status.message(), kMaxMessageBytes, /*keep_lines=*/true));
}

v1::Vector3 ToProto(const Eigen::Vector3d& v) {
  v1::Vector3 message;
  message.set_x(v.x()), message.set_y(v.y()), message.set_z(v.z());
  return message;
}

Eigen::Vector3d FromProto(const v1::Vector3& v) {
  return {v.x(), v.y(), v.z()};
}

absl::StatusOr<touch::CommandedTouch> FromProto(const v1::CommandedTouch& message, const std::string& where) {
  for (const auto& [present, name] :
       {std::pair(message.has_target_m(), "target_m"), std::pair(message.has_approach(), "approach"),
        std::pair(message.has_lateral(), "lateral")})
    if (!present)
      return absl::InvalidArgumentError(absl::StrCat(where, ".", name, " is missing: a touch needs it"));
  touch::CommandedTouch touch;
  touch.target_m = FromProto(message.target_m());
  touch.approach = FromProto(message.approach());
  touch.lateral = FromProto(message.lateral());
  touch.standoff_m = message.standoff_m();
  touch.speed_m_s = message.speed_m_s();
  if (message.has_stroke_m()) touch.stroke_m = message.stroke_m();
  if (message.has_session_time_s()) touch.session_time_s = message.session_time_s();
  touch.covariates.insert(message.covariates().begin(), message.covariates().end());
  TOUCHSTONE_RETURN_IF_ERROR(touch::MakeExact(&touch, where));
  return touch;
}

v1::CommandedTouch ToProto(const touch::CommandedTouch& touch) {
  return session::CommandMessage(touch);
}

absl::StatusOr<std::shared_ptr<const model::Model>> FromProto(const v1::ModelRef& message,
                                                              const Resources& resources) {
  switch (message.ref_case()) {
    case v1::ModelRef::kName:
      return resources.models->FindByName(message.name());
    case v1::ModelRef::kHash:
      return resources.models->FindByHash(message.hash());
    case v1::ModelRef::kYaml: {
      TOUCHSTONE_ASSIGN_OR_RETURN(model::Model model,
                                  ParseSentModel(message.yaml(), "model.yaml", resources.options));
      return std::make_shared<const model::Model>(std::move(model));
    }
    case v1::ModelRef::REF_NOT_SET:
      break;
  }
  return resources.default_model;
}

namespace {

v1::EffectStage StageToProto(model::Stage stage) {
  switch (stage) {
    case model::Stage::kPose:
      return v1::EFFECT_STAGE_POSE;
    case model::Stage::kContact:
      return v1::EFFECT_STAGE_CONTACT;
    case model::Stage::kMotion:
      return v1::EFFECT_STAGE_MOTION;
    case model::Stage::kSensor:
      return v1::EFFECT_STAGE_SENSOR;
    case model::Stage::kCameraPose:
      return v1::EFFECT_STAGE_CAMERA_POSE;
    case model::Stage::kProjection:
      return v1::EFFECT_STAGE_PROJECTION;
    case model::Stage::kShading:
      return v1::EFFECT_STAGE_SHADING;
    case model::Stage::kImageSensor:
      return v1::EFFECT_STAGE_IMAGE_SENSOR;
  }
  return v1::EFFECT_STAGE_UNSPECIFIED;
}

v1::ParameterArity ArityToProto(model::Arity arity) {
  switch (arity) {
    case model::Arity::kScalar:
      return v1::PARAMETER_ARITY_SCALAR;
    case model::Arity::kVector3:
      return v1::PARAMETER_ARITY_VECTOR3;
    case model::Arity::kVector2:
      return v1::PARAMETER_ARITY_VECTOR2;
    case model::Arity::kPerFinger:
      return v1::PARAMETER_ARITY_PER_FINGER;
  }
  return v1::PARAMETER_ARITY_UNSPECIFIED;
}

}  // namespace

v1::Effect ToProto(const model::Effect& effect) {
  v1::Effect message;
  message.set_name(effect.name);
  message.set_stage(StageToProto(effect.stage));
  message.set_meaning(effect.meaning);
  message.set_signature(effect.signature);
  message.set_check_on_rig(effect.check_on_rig);
  message.set_remedy(effect.remedy);
  for (const model::ParameterInfo& info : effect.parameters) {
    v1::Parameter* parameter = message.add_parameters();
    parameter->set_name(info.name);
    parameter->set_unit(std::string(UnitSymbol(info.unit)));
    parameter->set_arity(ArityToProto(info.arity));
    parameter->set_min(info.lower);
    parameter->set_max(info.upper);
    parameter->set_default_value(info.neutral);
    parameter->set_typical(info.typical);
    parameter->set_sum_zero(info.sum_zero);
    parameter->set_meaning(info.meaning);
  }
  return message;
}

v1::Model ToProto(const model::Model& model) {
  v1::Model message;
  message.set_name(model.name);
  message.set_hash(model.Hash());
  message.set_yaml(model::FormatModel(model));
  message.set_fingers(model.fingers);
  message.set_spacing_m(model.spacing_m);
  return message;
}

}  // namespace touchstone::service
