// A surface map as people and scripts meet it: the real binary finds it, applies it, sends it to a server, and writes the
// mesh that it measured.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "client/cli/tests/real_binary_test.h"
#include "client/cli/tests/test_server.h"

namespace touchstone::cli {
namespace {

using Json = nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class SurfaceMapCommandTest : public RealBinaryTest {
 protected:
  // Touches of two printed objects, in a file; the bumps depend on the model's seed alone, poses on the plan's.
  void MakeBumpySet(const std::string& name, const std::string& plan_seed) {
    Write("nominal.yaml", kQuietModelFile);
    Write("bumpy.yaml", absl::StrCat(kQuietModelFile, "  - surface_error: {rms_mm: 0.3, length_mm: 40}\n"));
    std::filesystem::create_directories(Path("meshes"));
    for (const char* shape : {"lat00", "lat20"})
      ASSERT_EQ(Run({"mesh", "supershape", shape, "--triangles", "2000", "-o",
                     absl::StrCat("meshes/", shape, ".off"), "--force"})
                    .exit_code,
                0);
    const Outcome plan =
        Run({"plan", "lat00,lat20", "--mesh-dir", "meshes", "--plan", "faces", "--samples-per-face", "16",
             "--rounds", "2", "--seed", plan_seed, "-o", absl::StrCat("plan_", name)});
    ASSERT_EQ(plan.exit_code, 0) << plan.err;
    const Outcome touch = Run({"touch", "--plan", absl::StrCat("plan_", name), "--mesh-dir", "meshes",
                               "--model", "bumpy.yaml", "--seed", "5", "-o", name});
    ASSERT_EQ(touch.exit_code, 0) << touch.err;
  }

  double Rmse(const std::string& set, const std::string& model, const std::vector<std::string>& more = {}) {
    std::vector<std::string> command = {"compare", set,      "--model",      model,    "--mesh-dir",
                                        "meshes",  "--json", "compare.json", "--force"};
    command.insert(command.end(), more.begin(), more.end());
    const Outcome outcome = Run(command);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome.exit_code == 0
               ? Json::parse(Read("compare.json"))["data"][0]["initial"]["rmse"].get<double>()
               : -1;
  }
};

TEST_F(SurfaceMapCommandTest, IsFoundAppliedSentAndWrittenAsAMesh) {
  MakeBumpySet("set.csv", "1");
  const Outcome found = Run({"diagnose", "set.csv", "--model", "nominal.yaml", "--mesh-dir", "meshes",
                             "--json", "report.json", "--save-model", "better.yaml", "--with-surface-map"});
  ASSERT_EQ(found.exit_code, 0) << found.err;
  EXPECT_THAT(found.err, HasSubstr("better.surface.csv (departures of 2 objects"));
  EXPECT_THAT(Read("better.yaml"), HasSubstr("- surface_map: {file: better.surface.csv}"));
  const Json report = Json::parse(Read("report.json"));
  ASSERT_EQ(report["steps"].size(), 1u) << report["summary"];
  EXPECT_EQ(report["steps"][0]["effect"], "surface_map");

  // The same touches, other touches, and the same at a server, which has no such file.
  const double error_us = report["data"][0]["final"]["rmse"];
  EXPECT_NEAR(Rmse("set.csv", "better.yaml"), error_us, 0.01 * error_us);
  MakeBumpySet("other.csv", "9");
  const double unseen_us = report["data"][0]["final"]["heldout_rmse"];
  const double other_us = Rmse("other.csv", "better.yaml");
  EXPECT_LT(other_us, 1.5 * unseen_us);
  EXPECT_GT(other_us, unseen_us / 1.5);
  EXPECT_GT(Rmse("other.csv", "nominal.yaml"), 1.5 * other_us);
  const TestServer server;
  EXPECT_NEAR(Rmse("set.csv", "better.yaml", {"--server", server.address()}), error_us, 0.01 * error_us);

  // Touches under the model are those of the map: the same from here and from a server.
  const std::vector<std::string> touch = {"touch", "--plan", "plan_set.csv", "--model", "better.yaml", "-o"};
  std::vector<std::string> here = touch;
  here.insert(here.end(), {"here.csv", "--mesh-dir", "meshes"});
  ASSERT_EQ(Run(here).exit_code, 0);
  EXPECT_LT(Rmse("here.csv", "better.yaml"), 2200);
  EXPECT_GT(Rmse("here.csv", "nominal.yaml"), 4000);

  // The mesh as it was measured takes the place of the map.
  std::filesystem::create_directories(Path("measured"));
  for (const std::string shape : {"lat00", "lat20"}) {
    const std::string mesh = absl::StrCat(shape, ".off");
    const Outcome corrected = Run({"mesh", "correct", absl::StrCat("meshes/", mesh), "--map",
                                   "better.surface.csv", "-o", absl::StrCat("measured/", mesh)});
    ASSERT_EQ(corrected.exit_code, 0) << corrected.err;
    EXPECT_THAT(corrected.out, AllOf(HasSubstr("Moved"), HasSubstr("Touched")));
  }
  const double with_meshes_us =
      Rmse("other.csv", "nominal.yaml",
           {"--mesh", "lat00=measured/lat00.off", "--mesh", "lat20=measured/lat20.off"});
  EXPECT_NEAR(with_meshes_us, other_us, 0.25 * other_us);
}

TEST_F(SurfaceMapCommandTest, ErrorsNameFileLineAndValue) {
  Write("bad.yaml", absl::StrCat(kQuietModelFile, "  - surface_map: {file: map.csv}\n"));
  Outcome outcome = Run({"model", "show", "bad.yaml"});
  EXPECT_NE(outcome.exit_code, 0);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("bad.yaml:6"), HasSubstr("map.csv")));
  Write("map.csv",
        "object,x_mm,y_mm,z_mm,departure_mm,std_dev_mm,length_mm,rms_mm\nlat00,0,0,75,1e3,0.1,20,0.3\n");
  outcome = Run({"model", "show", "bad.yaml"});
  EXPECT_THAT(outcome.err, HasSubstr("map.csv:2: column departure_mm: 1000 is out of range"));
  Write("map.csv",
        "object,x_mm,y_mm,z_mm,departure_mm,std_dev_mm,length_mm,rms_mm\nlat00,0,0,75,0.2,0.1,20,0.3\n");
  outcome = Run({"model", "show", "bad.yaml"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("lat00,0,0,75,0.2,0.1,20,0.3"));
  ASSERT_EQ(Run({"mesh", "supershape", "lat00", "--triangles", "500", "-o", "lat0.off"}).exit_code, 0);
  outcome = Run({"mesh", "correct", "lat0.off", "--map", "map.csv", "-o", "out.off"});
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("has no object 'lat0'"), HasSubstr("did you mean 'lat00'")));
  EXPECT_EQ(Run({"mesh", "correct", "lat0.off", "--map", "map.csv", "--object", "lat00", "-o", "out.off"})
                .exit_code,
            0);
  outcome = Run({"diagnose", "x.csv", "--with-surface-map"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--save-model"));
}

TEST_F(SurfaceMapCommandTest, GoesAlongWhenAModelIsChanged) {
  Write("map.csv",
        "object,x_mm,y_mm,z_mm,departure_mm,std_dev_mm,length_mm,rms_mm\nlat00,0,0,75,0.2,0.1,20,0.3\n");
  Write("nominal.yaml", kQuietModelFile);
  ASSERT_EQ(
      Run({"model", "add", "nominal.yaml", "surface_map", "file=map.csv", "-o", "mapped.yaml"}).exit_code, 0);
  EXPECT_EQ(Read("mapped.surface.csv"), Read("map.csv"));
  ASSERT_EQ(Run({"model", "add", "mapped.yaml", "tip_radius", "radius_mm=2", "-o", "both.yaml"}).exit_code,
            0);
  EXPECT_EQ(Read("both.surface.csv"), Read("map.csv"));
  const Outcome diff = Run({"model", "diff", "mapped.yaml", "both.yaml"});
  EXPECT_THAT(diff.out, AllOf(HasSubstr("tip_radius added"), Not(HasSubstr("surface_map"))));
  const Outcome removed = Run({"model", "diff", "nominal.yaml", "mapped.yaml"});
  EXPECT_THAT(removed.out, HasSubstr("surface_map added: departures of 1 object at 1 point"));
}

}  // namespace
}  // namespace touchstone::cli
