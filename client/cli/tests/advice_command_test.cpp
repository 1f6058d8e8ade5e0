// What a diagnosis advises is done by a command and found again, on the public sets: a mistake in the file is fixed, a
// curve without a name is added.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include <nlohmann/json.hpp>

#include "client/cli/tests/real_binary_test.h"
#include "server/base/test_paths.h"
#include "server/base/test_tier.h"

namespace touchstone::cli {
namespace {

using ::testing::HasSubstr;

const std::string kMeasurements = SharedData() + "/measurements";

class AdviceCommand : public RealBinaryTest {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kMeasurements + "/nominal.yaml"))
      GTEST_SKIP() << kMeasurements << " is not there";
  }

  nlohmann::json Diagnose(const std::string& set) {
    const Outcome outcome = Run({"diagnose", set, "--model", kMeasurements + "/nominal.yaml", "--mesh-dir",
                                 kMeasurements, "--json", "-"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return nlohmann::json::parse(outcome.out, nullptr, false);
  }
};

TEST_F(AdviceCommand, ACurveOrFormulaIsAddedAndItsErrorFoundAgain) {
  TOUCHSTONE_SECOND_TIER("long: whole diagnoses of three sets");
  for (const std::string name : {"outside_periodic", "outside_incidence_wave", "unlisted"}) {
    SCOPED_TRACE(name);
    const std::string set = absl::StrCat(kMeasurements, "/", name, ".csv");
    const Outcome outcome =
        Run({"diagnose", set, "--model", kMeasurements + "/nominal.yaml", "--mesh-dir", kMeasurements,
             "--save-model", name + ".yaml", "--with-formula", "--json", "-"});
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    const nlohmann::json report = nlohmann::json::parse(outcome.out, nullptr, false);
    EXPECT_EQ(report["verdict"], "UNEXPLAINED");
    const Outcome again =
        Run({"compare", set, "--model", name + ".yaml", "--mesh-dir", kMeasurements, "--json", "-"});
    ASSERT_EQ(again.exit_code, 0) << again.err;
    const double found_us = nlohmann::json::parse(again.out)["data"][0]["initial"]["rmse"];
    const double promised_us = report["data"][0]["unexplained"]["rmse"];
    EXPECT_NEAR(found_us, promised_us, 0.01 * promised_us);
    EXPECT_LT(found_us, 0.8 * report["data"][0]["initial"]["rmse"].get<double>());
  }
}

TEST_F(AdviceCommand, WithFormulaNeedsAModelToWrite) {
  const Outcome outcome = Run({"diagnose", "set.csv", "--with-formula"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("give --save-model FILE"));
}

TEST_F(AdviceCommand, MendsWhatTheDiagnosisFound) {
  TOUCHSTONE_SECOND_TIER("repeated: a diagnosis per mistake");
  for (const std::string name : {"outside_fingers_permuted", "outside_objects_swapped"}) {
    SCOPED_TRACE(name);
    const nlohmann::json before = Diagnose(absl::StrCat(kMeasurements, "/", name, ".csv"));
    ASSERT_EQ(before["verdict"], "CHECK_DATA");
    ASSERT_EQ(before["data_problems"].size(), 1u);
    EXPECT_TRUE(before["steps"].empty());
    const std::vector<std::string> words =
        absl::StrSplit(before["data_problems"][0]["fix"].get<std::string>(), ' ');
    ASSERT_EQ(words[0], "touchstone");
    std::vector<std::string> command(words.begin() + 1, words.end());
    command.push_back("--force");
    const Outcome repaired = Run(command);
    ASSERT_EQ(repaired.exit_code, 0) << repaired.err;
    EXPECT_THAT(repaired.err, HasSubstr("960 touches"));
    const nlohmann::json after = Diagnose("fixed.csv");
    EXPECT_EQ(after["verdict"], "MISSING_EFFECTS");
    ASSERT_FALSE(after["steps"].empty());
    EXPECT_EQ(after["steps"][0]["effect"], "tip_radius");
    // The error that was promised is the one that is found.
    EXPECT_NEAR(after["data"][0]["initial"]["rmse"].get<double>(),
                before["data_problems"][0]["error_after"].get<double>(), 1);
  }
}

// A mesh that lies in the folder, although the set does not name it, may be what was touched.
TEST_F(AdviceCommand, AMeshOfTheFolderThatTheSetDoesNotNameIsTried) {
  std::filesystem::create_directory(Path("meshes"));
  for (const char* object : {"lat00", "lat05", "lat10", "lat20"})
    std::filesystem::copy(kMeasurements + "/" + object + ".off", Path("meshes"));
  std::filesystem::copy(kMeasurements + "/lat05.off", Path("meshes/lat15.off"));  // a mistake
  std::filesystem::copy(kMeasurements + "/lat15.off", Path("meshes/elsewhere.off"));
  std::ofstream(Path("meshes/broken.off")) << "OFF\n3 1";
  const Outcome outcome = Run({"diagnose", kMeasurements + "/tip_radius.csv", "--model",
                               kMeasurements + "/nominal.yaml", "--mesh-dir", "meshes", "--json", "-"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const nlohmann::json report = nlohmann::json::parse(outcome.out, nullptr, false);
  EXPECT_EQ(report["verdict"], "CHECK_DATA");
  EXPECT_EQ(report["data_problems"][0]["kind"], "WRONG_MESH");
  EXPECT_EQ(report["data_problems"][0]["detail"], "lat15 is elsewhere");
}

TEST_F(AdviceCommand, SaysWhatItCannotDo) {
  const std::string set = kMeasurements + "/tip_radius.csv";
  const auto error = [&](const std::vector<std::string>& options) {
    std::vector<std::string> command = {"session", "fix", set};
    command.insert(command.end(), options.begin(), options.end());
    command.insert(command.end(), {"-o", "fixed.csv"});
    const Outcome outcome = Run(command);
    EXPECT_EQ(outcome.exit_code, 2);
    return outcome.err;
  };
  EXPECT_THAT(error({}), HasSubstr("nothing to fix was named"));
  EXPECT_THAT(error({"--swap-fingers", "l,q"}), HasSubstr("a finger from l to r was expected"));
  EXPECT_THAT(error({"--swap-objects", "lat10,cup"}), HasSubstr("has no object 'cup'; known: lat00, lat05"));
  EXPECT_THAT(error({"--scale-times", "0"}), HasSubstr("--scale-times: '0': a factor above 0 was expected"));
  EXPECT_THAT(error({"--scale-lengths", "-1"}), HasSubstr("--scale-lengths: '-1': a factor above 0"));
  EXPECT_THAT(error({"--permute-axes=x,x,z"}), HasSubstr("--permute-axes"));
  EXPECT_THAT(error({"--scale-speed", "1e9"}), HasSubstr("out of range"));
  EXPECT_THAT(error({"--touches", "9-3", "--swap-fingers", "l,m"}), HasSubstr("the first and the last"));
  EXPECT_THAT(error({"--touches", "5000", "--swap-fingers", "l,m"}), HasSubstr("has none of these touches"));
}

}  // namespace
}  // namespace touchstone::cli
