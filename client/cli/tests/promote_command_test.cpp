// model promote and demote as people meet them: the real binary.
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/cli/tests/real_binary_test.h"

namespace touchstone::cli {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

// monday.csv and friday.csv of a rig with balls for tips; better.yaml is what a diagnosis of monday.csv saves.
class PromoteCommandTest : public RealBinaryTest {
 protected:
  void SetUp() override {
    RealBinaryTest::SetUp();
    const std::string model =
        "touchstone: model/1\nname: rig\nend_effector: {fingers: 3, spacing_mm: 30}\n"
        "effects:\n  - gaussian_noise: {sigma_us: 2000}\n";
    Write("rig.yaml", model);
    Write("real.yaml", model + "  - tip_radius: {radius_mm: 2}\n");
    Write("wrong.yaml", model + "  - speed_error: {relative: 0.05}\n");
    Write(
        "same.yaml",
        "touchstone: model/1\nname: other\neffects:\n  - gaussian_noise: {sigma_us: 5000}\n");  // noise moves no error
    const auto make = [&](const std::string& file, const std::string& seed) {
      ASSERT_EQ(
          Run({"touch", "--plan", "plan.csv", "--model", "real.yaml", "--seed", seed, "-o", file}).exit_code,
          0);
    };
    ASSERT_EQ(Run({"plan", "lat20", "--plan", "faces", "--samples-per-face", "4", "--rounds", "2", "-o",
                   "plan.csv"})
                  .exit_code,
              0);
    make("monday.csv", "1"), make("friday.csv", "2");
    ASSERT_EQ(Run({"diagnose", "monday.csv", "--model", "rig.yaml", "--save-model", "better.yaml"}).exit_code,
              0);
  }
  Outcome Promote(const std::string& better, const std::string& set, const std::string& out = "rig2.yaml") {
    return Run({"model", "promote", better, "--over", "rig.yaml", "--on", set, "-o", out});
  }
};

TEST_F(PromoteCommandTest, ASavedModelSaysWhatItWasFittedTo) {
  EXPECT_THAT(Read("better.yaml"),
              AllOf(HasSubstr("over: {name: rig, hash:"), HasSubstr("- {set: monday.csv, sha256:"),
                    HasSubstr("unit: us, rmse_before:")));
  // A model that is changed is another one.
  ASSERT_EQ(Run({"model", "remove", "better.yaml", "tip_radius", "-o", "less.yaml"}).exit_code, 0);
  EXPECT_THAT(Read("less.yaml"), Not(HasSubstr("provenance")));
}

TEST_F(PromoteCommandTest, UnseenDataPromoteAndOneCommandUndoesIt) {
  const Outcome outcome = Promote("better.yaml", "friday.csv");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("promoted over rig.yaml"));
  EXPECT_THAT(Read("rig2.yaml"), AllOf(HasSubstr("name: rig2"), HasSubstr("tip_radius"),
                                       HasSubstr("set: friday.csv"), HasSubstr("difference_upper: -")));
  ASSERT_EQ(Run({"model", "demote", "rig2.yaml", "-o", "back.yaml"}).exit_code, 0);
  EXPECT_EQ(Read("back.yaml"), Read("rig.yaml"));
  // The promoted model is a model like any other.
  EXPECT_EQ(Run({"compare", "friday.csv", "--model", "rig2.yaml"}).exit_code, 0);
}

TEST_F(PromoteCommandTest, DataThatItWasFittedToDoNotPromote) {
  const Outcome outcome = Promote("better.yaml", "monday.csv");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("monday.csv is what better.yaml was fitted to"));
  Write("copy.csv", Read("monday.csv"));
  EXPECT_EQ(Promote("better.yaml", "copy.csv").exit_code, 2);
}

TEST_F(PromoteCommandTest, AModelThatErrsMoreOrNoLessIsRefusedWithTheInterval) {
  const Outcome worse = Promote("wrong.yaml", "friday.csv");
  EXPECT_EQ(worse.exit_code, 4);
  EXPECT_THAT(worse.err,
              AllOf(HasSubstr("wrong.yaml does not say what it was fitted to"),
                    HasSubstr("wrong.yaml is not promoted over rig.yaml"), HasSubstr("lies above 0")));
  EXPECT_THAT(Promote("same.yaml", "friday.csv").err, HasSubstr("holds 0"));
  EXPECT_EQ(Run({"model", "show", "rig2.yaml"}).exit_code, 2);
}

TEST_F(PromoteCommandTest, MistakesAreNamed) {
  EXPECT_THAT(Promote("rig.yaml", "friday.csv").err, HasSubstr("there is nothing to promote"));
  EXPECT_THAT(Promote("nowhere.yaml", "friday.csv").err, HasSubstr("nowhere.yaml"));
  EXPECT_THAT(Run({"model", "demote", "better.yaml", "-o", "x.yaml"}).err,
              HasSubstr("better.yaml was not promoted over another model"));
  EXPECT_THAT(Promote("better.yaml", "plan.csv").err, HasSubstr("plan.csv:1: has no column t_*_us"));
}

}  // namespace
}  // namespace touchstone::cli
