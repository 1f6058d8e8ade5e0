// How sure a model's predictions are, and models that are drawn, as people and scripts meet them: the real
// binary.
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "client/cli/tests/real_binary_test.h"

namespace touchstone::cli {
namespace {

using Json = nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr char kNominalFile[] =
    "touchstone: model/1\nname: nominal\nend_effector: {fingers: 3, spacing_mm: 30}\n"
    "effects:\n  - gaussian_noise: {sigma_us: 5000}\n";

// report.json of a set of 48 touches on lat20 that a rig with balls for tips made, better.yaml, the plan of
// the set.
class UncertaintyCommandTest : public RealBinaryTest {
 protected:
  void MakeReport() {
    Write("nominal.yaml", kNominalFile);
    Write("tips.yaml", std::string(kNominalFile) + "  - tip_radius: {radius_mm: 3}\n");
    for (const std::vector<std::string>& command : std::vector<std::vector<std::string>>{
             {"plan", "lat20", "--plan", "faces", "--samples-per-face", "4", "--rounds", "2", "-o",
              "plan.csv"},
             {"touch", "--plan", "plan.csv", "--model", "tips.yaml", "-o", "set.csv"},
             {"diagnose", "set.csv", "--model", "nominal.yaml", "--json", "report.json", "--save-model",
              "better.yaml"}})
      ASSERT_EQ(Run(command).exit_code, 0);
  }
  // Bytes of the first shard.
  std::string Stream(const std::string& folder, std::vector<std::string> options) {
    std::vector<std::string> command = {
        "stream",        "--objects",   "lat20",
        "--samples",     "400",         "--shard-size",
        "100",           "--columns",   "index,object,pose,descriptor,model_values",
        "--models-from", "report.json", "--out",
        folder};
    command.insert(command.end(), options.begin(), options.end());
    const Outcome outcome = Run(command);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return Read(folder + "/shard-000002.tar");
  }
};

TEST_F(UncertaintyCommandTest, ABudgetNamesWhatAPredictionIsUnsureBy) {
  MakeReport();
  const Outcome outcome = Run({"uncertainty", "report.json", "plan.csv"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("model 'nominal_better'"), HasSubstr("repeatability"),
                                 HasSubstr("reproducibility: not estimated")));
  const Json report = Json::parse(Run({"uncertainty", "report.json", "plan.csv", "--json", "-"}).out);
  const Json all = report["uncertainty"].back();
  const double sum = std::pow(all["parameters"].get<double>(), 2) +
                     std::pow(all["surface"].get<double>(), 2) +
                     std::pow(all["repeatability"].get<double>(), 2);
  EXPECT_NEAR(all["combined"].get<double>(), std::sqrt(sum), 1e-6 * std::sqrt(sum));
  EXPECT_EQ(all["contributions"][0]["name"], "repeatability");
  // A line of the terminal per contribution, here and in the diagnosis; largest first.
  for (const std::string& text : {outcome.out, Run({"diagnose", "set.csv", "--model", "nominal.yaml"}).out}) {
    size_t at = text.find("Budget ");
    ASSERT_NE(at, std::string::npos) << text;
    for (const Json& contribution : all["contributions"]) {
      at = text.find(absl::StrCat("\n            ", contribution["name"].get<std::string>(), " "), at);
      EXPECT_NE(at, std::string::npos) << contribution << text;
    }
  }
  EXPECT_FALSE(all.contains("reproducibility"));
  // The same touches: what the diagnosis itself says of them.
  EXPECT_EQ(Json::parse(Read("report.json"))["uncertainty"].back()["touches"], all["touches"]);
}

TEST_F(UncertaintyCommandTest, ADatasetHasTheUncertaintyOfEveryContactTimeOnRequest) {
  MakeReport();
  const Outcome outcome =
      Run({"stream", "--plan", "plan.csv", "--uncertainty", "report.json", "--to", "folder", "--out", "d"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  std::vector<std::string> names;
  const Json columns = Json::parse(Read("d/dataset.json"))["columns"];
  for (const Json& column : columns) names.push_back(column["name"].get<std::string>());
  EXPECT_THAT(names, testing::IsSupersetOf({"std_uncertainty_us", "beyond_measured"}));
  EXPECT_GT(Read("d/shard-000000/std_uncertainty_us.npy").size(), 48u * 3 * 4);
  ASSERT_EQ(Run({"stream", "--plan", "plan.csv", "--model", "better.yaml", "--to", "folder", "--out", "e"})
                .exit_code,
            0);
  // It changes no other column.
  EXPECT_EQ(Read("d/shard-000000/touches.csv"), Read("e/shard-000000/touches.csv"));
}

TEST_F(UncertaintyCommandTest, ModelsThatAreDrawnAreTheSameHoweverTheDatasetIsMade) {
  MakeReport();
  const std::string whole = Stream("whole", {});
  EXPECT_EQ(Stream("small", {"--batch-size", "7", "--threads", "1"}), whole);
  EXPECT_NE(Stream("other", {"--seed", "1"}), whole);
  EXPECT_EQ(Stream("one", {"--shards", "0/2"}), whole);  // a job of two has the shard too
  // A shard that was lost is made again.
  ASSERT_TRUE(std::filesystem::remove(Path("whole/shard-000002.tar")));
  EXPECT_EQ(Stream("whole", {}), whole);
  ASSERT_EQ(Run({"stream", "--like", "whole/dataset.json", "--out", "again"}).exit_code, 0);
  EXPECT_EQ(Read("again/shard-000002.tar"), whole);
  EXPECT_THAT(Read("whole/dataset.json"),
              AllOf(HasSubstr("\"posterior\""), HasSubstr("\"draw_models\": true")));
}

TEST_F(UncertaintyCommandTest, SaysWhyAReportHasNoUncertainty) {
  MakeReport();
  const auto error = [&](std::vector<std::string> command) {
    const Outcome outcome = Run(command);
    EXPECT_NE(outcome.exit_code, 0) << outcome.out;
    return outcome.err;
  };
  EXPECT_THAT(error({"uncertainty", "better.yaml", "plan.csv"}), HasSubstr("is no JSON object"));
  EXPECT_THAT(error({"uncertainty", "missing.json", "plan.csv"}), HasSubstr("missing.json"));
  Write("other.json", "{\"a\": 1}");
  EXPECT_THAT(error({"uncertainty", "other.json", "plan.csv"}), HasSubstr("is no report"));
  ASSERT_EQ(Run({"compare", "set.csv", "--model", "nominal.yaml", "--json", "compared.json"}).exit_code, 0);
  EXPECT_THAT(error({"uncertainty", "compared.json", "plan.csv"}), HasSubstr("as of `touchstone compare`"));
  EXPECT_THAT(error({"stream", "--models-from", "compared.json", "--out", "d"}),
              HasSubstr("as of `touchstone compare`"));
  EXPECT_THAT(error({"stream", "--models-from", "report.json", "--model", "nominal.yaml", "--out", "d"}),
              AllOf(HasSubstr("is that of model 'nominal_better'"), HasSubstr("but 'nominal'")));
  EXPECT_THAT(error({"stream", "--columns", "index,std_uncertainty", "--out", "d"}),
              HasSubstr("needs `posterior`"));
  EXPECT_THAT(error({"stream", "--uncertainty", "report.json", "--columns", "model_values", "--out", "d"}),
              HasSubstr("set draw_models too"));
  const std::string text = Read("report.json");
  Write("changed.json", std::string(text).insert(text.rfind("radius_mm: ") + 11, "1"));
  EXPECT_THAT(error({"uncertainty", "changed.json", "plan.csv"}), HasSubstr("posterior.model_hash"));
  Write("absent.csv", std::string(Read("plan.csv")).replace(Read("plan.csv").find(",lat20,"), 7, ",mug,"));
  EXPECT_THAT(error({"uncertainty", "report.json", "absent.csv"}), HasSubstr("mug"));
}

}  // namespace
}  // namespace touchstone::cli
