#include "tests/hidden_effects/generator/program.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/files/file_writer.h"
#include "server/base/test_folder.h"
#include "server/session/measurements/measurement_set.h"

namespace touchstone::hidden {
namespace {

constexpr char kModel[] =
    "touchstone: model/1\nname: nominal\nend_effector: {fingers: 3, spacing_mm: 30}\neffects:\n"
    "  - gaussian_noise: {sigma_us: 50}\n";
// From above, at two speeds, on a shape that the product has by name.
constexpr char kPlan[] =
    "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,approach_"
    "z,"
    "lateral_x,lateral_y,lateral_z\n"
    "5,lat20,20,80,0,0,40,0,0,-1,1,0,0\n6,lat20,10,80,5,0,40,0,0,-1,0,1,0\n";

class GeneratorProgram : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(WriteFileAtomically(folder_.Path("plan.csv"), kPlan).ok());
    ASSERT_TRUE(WriteFileAtomically(folder_.Path("model.yaml"), kModel).ok());
  }
  absl::StatusOr<Set> Make(const std::vector<std::string>& hide, uint64_t seed = 1) const {
    return GenerateForPlan({folder_.Path("plan.csv"), folder_.Path("model.yaml"), {}, hide, seed});
  }
  TestFolder folder_;
};

TEST_F(GeneratorProgram, MakesThePlansTouchesWithTheModelsNoise) {
  const absl::StatusOr<Set> set = Make({});
  ASSERT_TRUE(set.ok()) << set.status();
  const auto read = session::ParseMeasurementSet(set->csv, "set.csv"),
             plan = session::ParseMeasurementSet(kPlan, "plan.csv");
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->size(), 2);
  for (int row = 0; row < 2; ++row) {
    EXPECT_TRUE(read->target_m[row].isApprox(plan->target_m[row], 1e-9));
    EXPECT_NEAR(read->speed_m_s[row], plan->speed_m_s[row], 1e-12);
    for (int finger = 0; finger < 3; ++finger)
      EXPECT_NEAR(set->reported_us[row * 3 + finger], set->exact_time_us[row * 3 + finger], 300);
  }
  EXPECT_EQ(Make({})->csv, set->csv);
  EXPECT_NE(Make({}, 2)->csv, set->csv);
}

TEST_F(GeneratorProgram, HidesWhatItIsAskedTo) {
  const Set plain = *Make({}), fast = *Make({"speed_error relative=0.25"}), outside = *Make({"outside"});
  for (size_t i = 0; i < plain.exact_time_us.size(); ++i)
    EXPECT_NEAR(fast.exact_time_us[i], plain.exact_time_us[i] / 1.25, 1e-3);
  EXPECT_NE(outside.exact_time_us, plain.exact_time_us);
}

TEST_F(GeneratorProgram, SaysWhatItCannotHide) {
  EXPECT_FALSE(Make({"no_such_effect a=1"}).ok());
  EXPECT_FALSE(Make({"speed_error relative=much"}).ok());
}

}  // namespace
}  // namespace touchstone::hidden
