#include "server/diagnosis/engine/search/candidates.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace touchstone::diagnosis::engine {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(DiscriminatingMeasurement, IsWhatEitherOfAPairDeclares) {
  const std::string said = DiscriminatingMeasurement({"exposure", "gamma"});
  EXPECT_THAT(said, HasSubstr("wedge of grey steps"));
  EXPECT_EQ(DiscriminatingMeasurement({"gamma", "exposure"}), said);
  EXPECT_EQ(DiscriminatingMeasurement({"given:exposure", "gamma"}), said);
}

TEST(DiscriminatingMeasurement, TellsTheFirstFromEachOfTheOthers) {
  const std::string said = DiscriminatingMeasurement({"focal_error", "camera_translation", "object_scale"});
  EXPECT_THAT(said, HasSubstr("from two distances"));
  EXPECT_THAT(said, HasSubstr("with another camera"));
}

// They once were told to be touched at another speed.
TEST(DiscriminatingMeasurement, OfUndeclaredEffectsOfPhotographsIsACheckOfEach) {
  const std::string said = DiscriminatingMeasurement({"gamma", "ambient_light"});
  EXPECT_THAT(said, HasSubstr("For gamma: Double the shutter time"));
  EXPECT_THAT(said, HasSubstr("For ambient_light: Switch the lamps off"));
  EXPECT_THAT(said, Not(HasSubstr("speed")));
}

TEST(DiscriminatingMeasurement, OfUndeclaredEffectsOfTouchesIsWhatDiffersOnTheRig) {
  EXPECT_THAT(DiscriminatingMeasurement({"tool_yaw", "thermal_drift"}), HasSubstr("speed"));
}

TEST(DiscriminatingMeasurement, OfOneEffectIsWhatTellsItFromTheNameless) {
  EXPECT_THAT(DiscriminatingMeasurement({"exposure"}), HasSubstr("card of known reflectance"));
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
