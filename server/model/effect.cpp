#include "server/model/effect.h"

#include "server/base/check.h"

namespace touchstone::model {

const char* StageName(Stage stage) {
  switch (stage) {
    case Stage::kPose:
      return "pose";
    case Stage::kContact:
      return "contact";
    case Stage::kMotion:
      return "motion";
    case Stage::kSensor:
      return "sensor";
    case Stage::kCameraPose:
      return "camera pose";
    case Stage::kProjection:
      return "projection";
    case Stage::kShading:
      return "shading";
    case Stage::kImageSensor:
      return "image sensor";
  }
  TOUCHSTONE_CHECK(false && "every stage has a name");
  return "";
}

int Effect::ValueCount(int fingers) const {
  int count = 0;
  for (const ParameterInfo& parameter : parameters) count += parameter.Count(fingers);
  return count;
}

std::vector<double> Effect::NeutralValues(int fingers) const {
  std::vector<double> values;
  for (const ParameterInfo& parameter : parameters)
    values.insert(values.end(), parameter.Count(fingers), ToSi(parameter.unit, parameter.neutral));
  return values;
}

}  // namespace touchstone::model
