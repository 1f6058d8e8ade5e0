// A folder with touches and photographs of one session on the command line: diagnosed together, and found again.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include <nlohmann/json.hpp>

#include "client/cli/tests/real_binary_test.h"
#include "client/cli/tests/test_server.h"
#include "server/base/sanitizers.h"
#include "server/base/test_tier.h"
#include "server/diagnosis/joint_test_set.h"
#include "server/geometry/files/mesh_file.h"
#include "server/session/images/image_set_file.h"

namespace touchstone::cli {
namespace {

using diagnosis::joint::HiddenSession;
using ::testing::HasSubstr;

std::string CsvOf(const session::MeasurementSet& set) {
  std::string csv =
      "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,"
      "approach_z,"
      "lateral_x,lateral_y,lateral_z,t_l_us,t_m_us,t_r_us,session_time_s\n";
  for (size_t k = 0; k < set.touch.size(); ++k) {
    absl::StrAppend(&csv, set.touch[k], ",", set.objects[set.object[k]], ",", 1000 * set.speed_m_s[k], ",",
                    1000 * set.standoff_m[k]);
    for (int axis = 0; axis < 3; ++axis) absl::StrAppendFormat(&csv, ",%.9g", 1000 * set.target_m[k][axis]);
    for (int axis = 0; axis < 3; ++axis) absl::StrAppendFormat(&csv, ",%.12g", set.approach[k][axis]);
    for (int axis = 0; axis < 3; ++axis) absl::StrAppendFormat(&csv, ",%.12g", set.lateral[k][axis]);
    for (int finger = 0; finger < 3; ++finger) {
      const double time_s = set.time_s[3 * k + finger];
      absl::StrAppend(&csv, ",", std::isnan(time_s) ? "" : absl::StrFormat("%.1f", 1e6 * time_s));
    }
    absl::StrAppend(&csv, ",", set.session_time_s[k], "\n");
  }
  return csv;
}

class JointCommand : public RealBinaryTest {
 protected:
  void WriteSession(const std::string& name, const HiddenSession& hidden) {
    const diagnosis::DiagnosisInput input = diagnosis::joint::MakeJointInput(hidden);
    ASSERT_TRUE(session::WriteImageSet(*input.images, Path(name)).ok());
    Write(absl::StrCat(name, "/touches.csv"), CsvOf(*input.set));
    Write("nominal.yaml", model::FormatModel(*input.model));
    std::filesystem::create_directories(Path("meshes"));
    for (const auto& [object, surface] : input.surfaces)
      ASSERT_TRUE(
          geometry::WriteMeshFile(Path(absl::StrCat("meshes/", object, ".off")), surface->mesh()).ok());
  }

  nlohmann::json Report(std::vector<std::string> command) {
    for (const char* word : {"--mesh-dir", "meshes", "--json", "-"}) command.push_back(word);
    const Outcome outcome = Run(command);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return nlohmann::json::parse(outcome.out, nullptr, false);
  }

  // One object lies rotated, which both kinds show; the camera exposes longer, which only its pictures show.
  static HiddenSession Rotated() {
    HiddenSession session = diagnosis::joint::WithHidden(
        {{"object_pose", {"translation_mm=0.5,-0.4,0.3", "rotation_deg=0.3,0.2,-0.4"}}});
    session.camera.hidden.push_back({"exposure", {"stops=0.2"}});
    session.rig.objects = session.camera.objects = {"lat00", "lat20"};
    session.rig.samples_per_face = 3;
    session.camera.photographs = 6;
    return session;
  }
};

const nlohmann::json& StepOf(const nlohmann::json& report, const std::string& effect) {
  static const nlohmann::json none = nlohmann::json::object();
  for (const nlohmann::json& step : report["steps"])
    if (step["effect"] == effect) return step;
  return none;
}

TEST_F(JointCommand, OneDiagnosisOfBothIsFoundAgainByComparisons) {
  TOUCHSTONE_SECOND_TIER("long: whole diagnoses of pictures and touches");
  WriteSession("session", Rotated());
  const nlohmann::json report = Report({"diagnose", "session", "--model", "nominal.yaml", "--save-model",
                                        "better.yaml", "--html", "report.html"});
  ASSERT_EQ(report["verdict"], "MISSING_EFFECTS") << report["summary"];
  ASSERT_EQ(report["steps"].size(), 2u) << report["summary"];
  const nlohmann::json pose = StepOf(report, "object_pose"), exposure = StepOf(report, "exposure");
  EXPECT_EQ(pose["shown_by"], nlohmann::json({"TOUCHES", "PHOTOGRAPHS"}));
  EXPECT_EQ(exposure["shown_by"], nlohmann::json({"PHOTOGRAPHS"}));
  for (const nlohmann::json& value : pose["parameters"]) {
    ASSERT_EQ(value["alone"].size(), 2u);
    for (const nlohmann::json& alone : value["alone"])
      EXPECT_LT(value["std_error"].get<double>(), alone["std_error"].get<double>()) << alone["kind"];
  }
  const nlohmann::json given = Report({"compare", "session", "--model", "nominal.yaml"});
  const nlohmann::json better = Report({"compare", "session", "--model", "better.yaml"});
  ASSERT_EQ(report["data"].size(), 2u);
  for (size_t kind = 0; kind < 2; ++kind) {
    const nlohmann::json& data = report["data"][kind];
    const auto compared = [kind](const nlohmann::json& of) {
      return of["data"][kind]["initial"]["rmse"].get<double>();
    };
    const double initial = data["initial"]["rmse"], final = data["final"]["rmse"];
    EXPECT_NEAR(initial, compared(given), 1e-9 * initial) << data["unit"];
    EXPECT_NEAR(final, compared(better), 1e-4 * final) << data["unit"];
    EXPECT_LT(final, 0.7 * initial) << data["unit"];
    EXPECT_EQ(data["after_step"].size(), report["steps"].size());
  }
  for (const char* part :
       {"\"shown_by\":[\"TOUCHES\",\"PHOTOGRAPHS\"]", "\"touch_table\":{", "\"after_png\":\"iVBOR"})
    EXPECT_THAT(Read("report.html"), HasSubstr(part));

  // A session of both that a server keeps says the same.
  if (kUnderSanitizers) return;
  const TestServer server;
  ASSERT_EQ(
      Run({"session", "import", "session", "--session", "both", "--server", server.address()}).exit_code, 0);
  const nlohmann::json there =
      Report({"diagnose", "both", "--model", "nominal.yaml", "--server", server.address()});
  EXPECT_EQ(report["steps"], there["steps"]);
  EXPECT_EQ(report["verdict"], there["verdict"]);
  EXPECT_EQ(report["improved_model_hash"], there["improved_model_hash"]);
}

TEST_F(JointCommand, ProposesOfASetOfBothTheKindThatIsAskedFor) {
  WriteSession("session", Rotated());
  const auto propose = [this](const std::vector<std::string>& how) {
    std::vector<std::string> command = {"propose",      "session",    "--model",
                                        "nominal.yaml", "--mesh-dir", "meshes"};
    command.insert(command.end(), how.begin(), how.end());
    return Run(command);
  };
  const Outcome pictures = propose({"-o", "pictures.csv"});
  EXPECT_THAT(pictures.err, HasSubstr("--touches N proposes touches"));
  EXPECT_EQ(propose({"--touches", "8", "-o", "touches.csv"}).exit_code, 0);
  EXPECT_THAT(Read("touches.csv"), HasSubstr("standoff_mm"));
  const Outcome both = propose({"--touches", "8", "--photographs", "4", "-o", "both.csv"});
  EXPECT_EQ(both.exit_code, 2);
  EXPECT_THAT(both.err, HasSubstr("a plan is of one"));
}

}  // namespace
}  // namespace touchstone::cli
