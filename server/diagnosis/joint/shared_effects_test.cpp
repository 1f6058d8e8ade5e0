#include "server/diagnosis/joint/shared_effects.h"

#include <gtest/gtest.h>

#include <iostream>

#include "server/diagnosis/joint/joint_test_set.h"

namespace touchstone::diagnosis::joint {
namespace {

void Print(const char* what, const std::vector<inference::ParameterEstimate>& parameters) {
  std::cout << "    " << what << "\n";
  for (const auto& e : parameters)
    std::cout << "      " << e.object << " " << e.name << e.entry << " = " << e.value << " +- " << e.std_error
              << " (touches " << e.std_error_touches.value_or(-1) << ", photographs "
              << e.std_error_photographs.value_or(-1) << ")\n";
}

SharedEffects Found(const HiddenSession& session) {
  const JointInputs inputs = MakeInputs(session);
  ThreadPool pool(2);
  DiagnosisContext context;
  context.pool = &pool;
  const absl::StatusOr<SharedEffects> found = FindSharedEffects(inputs.touches, inputs.photographs, context);
  EXPECT_TRUE(found.ok()) << found.status();
  if (!found.ok()) return {};
  for (const SharedStep& step : found->steps) {
    std::cout << "  + " << step.effect << " " << step.probability << " gain " << step.gain_nats << " shown by "
              << step.shown_by << " " << step.words << "\n";
    Print("values", step.parameters);
  }
  for (const Conflict& conflict : found->conflicts) {
    std::cout << "  conflict " << conflict.effect << " p " << conflict.p << " ahead " << conflict.ahead_nats << "\n";
    Print("touches", conflict.touches);
    Print("photographs", conflict.photographs);
  }
  return *found;
}

const images::NamedValues kAskew = {
    {"object_pose", {"translation_mm=0.4,-0.3,0.2", "rotation_deg=0.3,0.2,-0.4"}}};

TEST(SharedEffects, ObjectPutDownAskewIsFoundByBothAndTighterThanByEither) {
  const SharedEffects found = Found(WithHidden(kAskew));
  ASSERT_EQ(found.steps.size(), 1u);
  EXPECT_TRUE(found.conflicts.empty());
  const SharedStep& step = found.steps[0];
  EXPECT_EQ(step.effect, "object_pose");
  EXPECT_EQ(step.shown_by, "both");
  const double truth[] = {0.4, -0.3, 0.2, 0.3, 0.2, -0.4};
  ASSERT_EQ(step.parameters.size(), 6u);
  for (int i = 0; i < 6; ++i) {
    const inference::ParameterEstimate& e = step.parameters[i];
    EXPECT_NEAR(e.value, truth[i], 4 * e.std_error) << e.name << e.entry;
    ASSERT_TRUE(e.std_error_touches && e.std_error_photographs);
    EXPECT_LT(e.std_error, *e.std_error_touches);
    EXPECT_LT(e.std_error, *e.std_error_photographs);
  }
}

TEST(SharedEffects, NothingIsFoundWhereNothingIsMissing) {
  const SharedEffects found = Found(WithHidden({}));
  EXPECT_TRUE(found.steps.empty());
  EXPECT_TRUE(found.conflicts.empty());
}

TEST(SharedEffects, ToolIsNotToldAsThePoseOfObjects) {
  HiddenSession session = WithHidden({});
  session.rig.hidden = {{"tool_yaw", {"angle_deg=1"}}};
  const SharedEffects found = Found(session);
  EXPECT_TRUE(found.steps.empty());
  EXPECT_TRUE(found.conflicts.empty());
}

TEST(SharedEffects, CameraIsNotToldAsThePoseOfObjects) {
  HiddenSession session = WithHidden({});
  session.camera.hidden = {{"camera_translation", {"offset_mm=0.8,-0.6,0"}}};
  const SharedEffects found = Found(session);
  EXPECT_TRUE(found.steps.empty());
  EXPECT_TRUE(found.conflicts.empty());
}

TEST(SharedEffects, ConflictIsSaidAndNotAveraged) {
  HiddenSession session = WithHidden({});
  session.rig.hidden = {{"object_pose", {"translation_mm=0.8,0,0"}}};
  session.camera.hidden = {{"object_pose", {"translation_mm=0,0.8,0"}}};
  const SharedEffects found = Found(session);
  EXPECT_TRUE(found.steps.empty());
  ASSERT_EQ(found.conflicts.size(), 1u);
  EXPECT_EQ(found.conflicts[0].effect, "object_pose");
}

}  // namespace
}  // namespace touchstone::diagnosis::joint
