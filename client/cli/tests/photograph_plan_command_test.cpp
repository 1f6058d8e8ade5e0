// Which pictures to take next, on the command line: propose, and capture that takes them.
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include <nlohmann/json.hpp>

#include "client/cli/tests/real_binary_test.h"
#include "server/base/sanitizers.h"
#include "server/diagnosis/images/photo_test_set.h"
#include "server/geometry/files/mesh_file.h"
#include "server/session/images/image_set_file.h"
#include "server/session/images/images_csv.h"

namespace touchstone::cli {
namespace {

using ::testing::HasSubstr;

class PhotographPlanCommand : public RealBinaryTest {
 protected:
  // `photographs` of each of two objects, with another focal length than the model's.
  void WriteSet(int photographs) {
    diagnosis::images::HiddenCamera rig;
    rig.objects = {"lat10", "lat20"};
    rig.photographs = photographs;
    rig.side_px = 96;
    rig.hidden = {{"focal_error", {"relative=0.02"}}};
    const diagnosis::DiagnosisInput input = diagnosis::images::MakePhotoInput(rig);
    ASSERT_TRUE(session::WriteImageSet(*input.images, Path("photos")).ok());
    Write("nominal.yaml", model::FormatModel(*input.model));
    std::filesystem::create_directories(Path("meshes"));
    for (const auto& [object, surface] : input.surfaces) {
      ASSERT_TRUE(
          geometry::WriteMeshFile(Path(absl::StrCat("meshes/", object, ".off")), surface->mesh()).ok());
    }
  }

  Outcome Propose(std::vector<std::string> more) {
    std::vector<std::string> command = {"propose",      "photos",     "--model",
                                        "nominal.yaml", "--mesh-dir", "meshes"};
    command.insert(command.end(), more.begin(), more.end());
    return Run(command);
  }
};

TEST_F(PhotographPlanCommand, AProposedPlanCanBePhotographed) {
  if (kUnderSanitizers) GTEST_SKIP() << "a whole diagnosis";
  WriteSet(4);
  const Outcome outcome = Propose({"--photographs", "4", "-o", "next.csv", "--json", "next.json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("4 pictures"));
  EXPECT_THAT(outcome.err, HasSubstr("tells focal_error from"));
  const nlohmann::json report = nlohmann::json::parse(Read("next.json"));
  ASSERT_EQ(report["next"].size(), 4u);
  EXPECT_GE(report["next"][0]["count_to_verdict"].get<int>(), 1);
  EXPECT_GT(report["next"][0]["separation"].get<double>(), 0);
  // Every effect as the first step, the best one first, with what it alone leaves.
  EXPECT_TRUE(report["next"][0].contains("photograph"));
  const nlohmann::json data = report["data"][0];
  ASSERT_GE(data["candidates"].size(), 10u);
  EXPECT_EQ(data["candidates"][0]["effect"], "focal_error");
  EXPECT_LT(data["candidates"][0]["rmse"].get<double>(), data["initial"]["rmse"].get<double>());
  const auto plan = session::ParseImagesCsv(Read("next.csv"), "next.csv");
  ASSERT_TRUE(plan.ok()) << plan.status();
  ASSERT_EQ(plan->size(), 4u);
  EXPECT_THAT(plan->photographs[0].file, HasSubstr(plan->objects[plan->photographs[0].object] + "_from_"));
  const std::string object = plan->objects[0];
  const auto rows = std::count_if(plan->photographs.begin(), plan->photographs.end(),
                                  [](const auto& row) { return row.object == 0; });
  const Outcome taken = Run({"capture", object, "--mesh-dir", "meshes", "--plan", "next.csv", "--image",
                             "64x64", "-o", "more/picture.png"});
  ASSERT_EQ(taken.exit_code, 0) << taken.err;
  const auto files =
      std::distance(std::filesystem::directory_iterator(Path("more")), std::filesystem::directory_iterator());
  EXPECT_EQ(files, rows);
  const Outcome none =
      Run({"capture", "lat00", "--mesh-dir", "meshes", "--plan", "next.csv", "-o", "none/picture.png"});
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, HasSubstr("next.csv: has no picture of 'lat00'; it has pictures of "));
}

TEST_F(PhotographPlanCommand, TooFewPicturesGetPicturesToAdd) {
  WriteSet(2);
  const Outcome outcome = Propose({"--photographs", "3", "-o", "next.csv"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("too little for a verdict; pictures from 6 poses would do"));
  const auto plan = session::ParseImagesCsv(Read("next.csv"), "next.csv");
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->size(), 3u);
  EXPECT_EQ(Propose({"--photographs", "0"}).exit_code, 2);
}

}  // namespace
}  // namespace touchstone::cli
