// model promote and demote as people meet them: the real binary.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_replace.h>
#include <absl/strings/str_split.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

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

TEST_F(PromoteCommandTest, TheFileBeforeComesBackByteForByteWhateverHappenedToTheOther) {
  const std::string before = "# bench 2, since May\n\n" + Read("rig.yaml") + "# end";
  Write("rig.yaml", before);
  ASSERT_EQ(Promote("better.yaml", "friday.csv").exit_code, 0);
  ASSERT_EQ(Run({"model", "demote", "rig2.yaml", "-o", "back.yaml"}).exit_code, 0);
  EXPECT_EQ(Read("back.yaml"), before);

  // Changed by hand: said, and restored all the same; so is one that is read only, by a link.
  const std::string promoted = Read("rig2.yaml");
  const size_t spacing = promoted.find("spacing_mm: 30");
  Write("rig2.yaml", std::string(promoted).replace(spacing, 14, "spacing_mm: 31"));
  std::filesystem::permissions(Path("rig2.yaml"), std::filesystem::perms::owner_read);
  std::filesystem::create_symlink("rig2.yaml", Path("link.yaml"));
  const Outcome changed = Run({"model", "demote", "link.yaml", "-o", "back2.yaml"});
  ASSERT_EQ(changed.exit_code, 0) << changed.err;
  EXPECT_THAT(changed.err, HasSubstr("note: link.yaml was changed since it was promoted (hash "));
  EXPECT_EQ(Read("back2.yaml"), before);

  // What is to be restored was changed: that is no longer the file before.
  Write("rig3.yaml", absl::StrReplaceAll(promoted, {{"spacing_mm: 30", "spacing_mm: 31"}}));
  EXPECT_THAT(Run({"model", "demote", "rig3.yaml", "-o", "back3.yaml"}).err,
              HasSubstr("rig3.yaml: provenance.promoted.before was changed"));

  // Into what a link leads to; the link stays.
  Write("rig.yaml", "other");
  std::filesystem::create_symlink("rig.yaml", Path("current.yaml"));
  EXPECT_THAT(Run({"model", "demote", "rig2.yaml", "-o", "current.yaml"}).err,
              HasSubstr("--force to replace it"));
  ASSERT_EQ(Run({"model", "demote", "rig2.yaml", "-o", "current.yaml", "--force"}).exit_code, 0);
  EXPECT_TRUE(std::filesystem::is_symlink(Path("current.yaml")));
  EXPECT_EQ(Read("rig.yaml"), before);
}

TEST_F(PromoteCommandTest, DataThatItWasFittedToDoNotPromote) {
  const Outcome outcome = Promote("better.yaml", "monday.csv");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("monday.csv holds what better.yaml was fitted to"));
}

TEST_F(PromoteCommandTest, ACopyInAnotherFormIsNoUnseenData) {
  const std::string monday = Read("monday.csv");
  Write("crlf.csv", absl::StrReplaceAll(monday, {{"\n", "\r\n"}}));
  std::string reversed;
  for (const absl::string_view line : absl::StrSplit(monday, '\n', absl::SkipEmpty())) {
    std::vector<std::string> fields = absl::StrSplit(line, ',');
    std::reverse(fields.begin(), fields.end());
    absl::StrAppend(&reversed, absl::StrJoin(fields, ","), "\n");
  }
  Write("columns.csv", reversed);
  for (const char* copy : {"crlf.csv", "columns.csv"}) {
    const Outcome outcome = Promote("better.yaml", copy);
    EXPECT_EQ(outcome.exit_code, 2) << copy;
    EXPECT_THAT(outcome.err,
                HasSubstr(absl::StrCat("--on: ", copy, " holds what better.yaml was fitted to (monday.csv")));
  }
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
