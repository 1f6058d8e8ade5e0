// Folders of photographs on the command line: compared, diagnosed, fixed. The pictures are the simulator's own, with
// something hidden.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "client/cli/tests/real_binary_test.h"
#include "client/cli/tests/test_server.h"
#include "server/base/sanitizers.h"
#include "server/base/test_tier.h"
#include "server/diagnosis/images/photo_test_set.h"
#include "server/geometry/files/mesh_file.h"
#include "server/session/images/image_set_file.h"

namespace touchstone::cli {
namespace {

using diagnosis::images::HiddenCamera;
using ::testing::HasSubstr;

class PhotographCommand : public RealBinaryTest {
 protected:
  // A folder, the meshes of its objects, and the model without what is hidden.
  void WriteSet(const std::string& name, const HiddenCamera& rig) {
    const diagnosis::DiagnosisInput input = diagnosis::images::MakePhotoInput(rig);
    ASSERT_TRUE(session::WriteImageSet(*input.images, Path(name)).ok());
    Write("nominal.yaml", model::FormatModel(*input.model));
    std::filesystem::create_directories(Path("meshes"));
    for (const auto& [object, surface] : input.surfaces) {
      ASSERT_TRUE(
          geometry::WriteMeshFile(Path(absl::StrCat("meshes/", object, ".off")), surface->mesh()).ok());
    }
  }

  nlohmann::json Report(std::vector<std::string> command) {
    for (const char* word : {"--mesh-dir", "meshes", "--json", "-"}) command.push_back(word);
    const Outcome outcome = Run(command);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return nlohmann::json::parse(outcome.out, nullptr, false);
  }

  static HiddenCamera Small() {
    HiddenCamera rig;
    rig.photographs = 6;
    rig.side_px = 96;
    return rig;
  }
};

TEST_F(PhotographCommand, EveryErrorOfADiagnosisIsFoundAgainByComparisons) {
  HiddenCamera rig = Small();
  rig.hidden = {{"exposure", {"stops=0.3"}}};
  WriteSet("photos", rig);
  const nlohmann::json report = Report({"diagnose", "photos", "--model", "nominal.yaml", "--save-model",
                                        "better.yaml", "--html", "report.html"});
  ASSERT_EQ(report["steps"].size(), 1u) << report["summary"];
  EXPECT_EQ(report["steps"][0]["effect"], "exposure");
  ASSERT_EQ(report["data"].size(), 1u);
  EXPECT_EQ(report["data"][0]["count"], 18);
  EXPECT_EQ(report["data"][0]["kind"], "PHOTOGRAPHS");
  EXPECT_EQ(report["data"][0]["unit"], "grey");
  const nlohmann::json given = Report({"compare", "photos", "--model", "nominal.yaml"});
  const nlohmann::json better = Report({"compare", "photos", "--model", "better.yaml"});
  const auto rmse = [](const nlohmann::json& of) { return of["rmse"].get<double>(); };
  const nlohmann::json data = report["data"][0], improved = better["data"][0];
  EXPECT_NEAR(rmse(data["initial"]), rmse(given["data"][0]["initial"]), 1e-9);
  EXPECT_NEAR(rmse(data["final"]), rmse(improved["initial"]), 1e-4 * rmse(data["final"]));
  EXPECT_NEAR(rmse(data["after_step"][0]), rmse(improved["initial"]), 0.01 * rmse(data["final"]));
  EXPECT_LT(rmse(data["final"]), 0.5 * rmse(data["initial"]));
  EXPECT_NEAR(data["photographs"]["silhouette_iou_after"].get<double>(),
              improved["photographs"]["silhouette_iou"].get<double>(), 1e-3);
  // The page carries its pictures and loads nothing.
  const std::string page = Read("report.html");
  EXPECT_THAT(page, HasSubstr("\"measured_png\":\"iVBOR"));
  EXPECT_THAT(page, HasSubstr("\"residual_after_png\":\"iVBOR"));
  EXPECT_EQ(page.find("src=\"http"), std::string::npos);
}

TEST_F(PhotographCommand, AServerFindsTheSame) {
  if (kUnderSanitizers) GTEST_SKIP() << "another whole diagnosis";
  HiddenCamera rig = Small();
  rig.hidden = {{"exposure", {"stops=0.3"}}};
  WriteSet("photos", rig);
  const TestServer server;
  nlohmann::json here = Report({"compare", "photos", "--model", "nominal.yaml"});
  nlohmann::json there =
      Report({"compare", "photos", "--model", "nominal.yaml", "--server", server.address()});
  for (nlohmann::json* report : {&here, &there}) report->erase("duration_s"), report->erase("provenance");
  EXPECT_EQ(here, there);
}

TEST_F(PhotographCommand, WithoutAHiddenEffectNothingIsClaimed) {
  if (kUnderSanitizers) GTEST_SKIP() << "another whole diagnosis";
  WriteSet("photos", Small());
  const nlohmann::json report = Report({"diagnose", "photos", "--model", "nominal.yaml"});
  EXPECT_EQ(report["verdict"], "ADEQUATE") << report["summary"];
  EXPECT_TRUE(report["steps"].empty());
  EXPECT_GT(report["data"][0]["photographs"]["silhouette_iou"].get<double>(), 0.99);
}

TEST_F(PhotographCommand, PrintedFixesLeadToThePromisedError) {
  TOUCHSTONE_SECOND_TIER("repeated: a diagnosis per mistake");
  if (kUnderSanitizers) GTEST_SKIP() << "dozens of starts of a program";
  WriteSet("photos", Small());
  int number = 0;
  for (const std::vector<std::string>& mistake :
       std::vector<std::vector<std::string>>{{"--mirror", "left-right"},
                                             {"--rotate", "90"},
                                             {"--focal-factor", "0.5"},
                                             {"--scale-camera", "2"},
                                             {"--scale-lengths", "0.001"},
                                             {"--swap-eye-at"},
                                             {"--permute-axes=x,-z,y"},
                                             {"--up=1,0,0"},
                                             {"--swap-objects", "lat00,lat20"},
                                             {"--shift-rows=1"}}) {
    SCOPED_TRACE(mistake[0]);
    const std::string corrupted = absl::StrCat("corrupted", ++number);
    std::vector<std::string> corrupt = {"session", "fix", "photos", "-o", corrupted};
    corrupt.insert(corrupt.end(), mistake.begin(), mistake.end());
    const Outcome corrupting = Run(corrupt);
    ASSERT_EQ(corrupting.exit_code, 0) << corrupting.err;
    const nlohmann::json report = Report({"diagnose", corrupted, "--model", "nominal.yaml"});
    ASSERT_EQ(report["verdict"], "CHECK_DATA");
    EXPECT_TRUE(report["steps"].empty());
    const nlohmann::json problem = report["data_problems"][0];
    // As it is printed, but for the program's name and where it writes.
    std::vector<std::string> fix = absl::StrSplit(problem["fix"].get<std::string>(), ' ');
    fix.erase(fix.begin());
    ASSERT_EQ(fix.back(), "fixed");
    fix.back() = absl::StrCat("fixed", number);
    const Outcome fixing = Run(fix);
    ASSERT_EQ(fixing.exit_code, 0) << fixing.err;
    const nlohmann::json fixed = Report({"compare", fix.back(), "--model", "nominal.yaml"});
    const double promised = problem["error_after"], found = fixed["data"][0]["initial"]["rmse"];
    EXPECT_NEAR(found, promised, 1e-6 * promised);
    EXPECT_LT(found, 0.3 * problem["error_before"].get<double>());
  }
}

TEST_F(PhotographCommand, TouchesBesideArePartOfAComparison) {
  WriteSet("photos", Small());
  ASSERT_EQ(
      Run({"plan", "lat00", "--plan", "faces", "--samples-per-face", "1", "--rounds", "2", "-o", "plan.csv"})
          .exit_code,
      0);
  ASSERT_EQ(Run({"touch", "--plan", "plan.csv", "-o", "photos/touches.csv"}).exit_code, 0);
  const nlohmann::json compared = Report({"compare", "photos", "--model", "nominal.yaml"});
  ASSERT_EQ(compared["data"].size(), 2u);
  EXPECT_EQ(compared["data"][0]["kind"], "TOUCHES");
  EXPECT_GE(compared["data"][0]["count"].get<int>(), 8);
  EXPECT_EQ(compared["data"][1]["kind"], "PHOTOGRAPHS");
  EXPECT_GT(compared["data"][1]["initial"]["rmse"].get<double>(), 0);
}

TEST_F(PhotographCommand, MessagesNameWhatIsWrong) {
  WriteSet("photos", Small());
  struct Case {
    std::vector<std::string> command;
    std::string error;
  };
  std::filesystem::create_directories(Path("empty"));
  for (const Case& wrong : std::vector<Case>{
           {{"compare", "empty", "--model", "nominal.yaml"}, "images.csv"},
           {{"session", "fix", "photos", "--rotate", "45", "-o", "out"}, "90, 180 or 270"},
           {{"session", "fix", "photos", "--mirror", "sideways", "-o", "out"}, "left-right or up-down"},
           {{"session", "fix", "photos", "--swap-fingers", "l,m", "-o", "out"}, "for measurement files"},
           {{"session", "fix", "photos", "--swap-channels", "-o", "out"}, "grey"},
           {{"session", "fix", "photos", "--swap-objects", "lat00,lat02", "-o", "out"}, "did you mean"},
           {{"session", "fix", "photos", "--images", "90-99", "--mirror", "left-right", "-o", "out"},
            "none of these pictures"},
           {{"session", "fix", "photos", "-o", "out"}, "nothing to fix was named"},
           {{"session", "fix", "photos", "--mirror", "up-down", "-o", "photos"}, "photos"}}) {
    SCOPED_TRACE(wrong.error);
    const Outcome outcome = Run(wrong.command);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(wrong.error));
    EXPECT_FALSE(std::filesystem::exists(Path("out")));
  }
}

}  // namespace
}  // namespace touchstone::cli
