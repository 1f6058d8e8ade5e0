// Plans and views that know the object, on the command line: plan, touch, capture and mesh.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include <nlohmann/json.hpp>

#include "client/cli/tests/real_binary_test.h"
#include "server/base/test_paths.h"
#include "server/image/encoding/encode.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class PlanCommandTest : public RealBinaryTest {
 protected:
  // A box with these corners, in millimetres.
  void WriteBox(const std::string& name, const std::string& low, const std::string& high) {
    const auto numbers = [](const std::string& text) {
      std::vector<std::string> parts;
      for (size_t begin = 0; begin <= text.size();) {
        const size_t end = std::min(text.find(' ', begin), text.size());
        parts.push_back(text.substr(begin, end - begin));
        begin = end + 1;
      }
      return parts;
    };
    const std::vector<std::string> corners[2] = {numbers(low), numbers(high)};
    std::string text = "OFF\n8 6 0\n";
    for (int corner = 0; corner < 8; ++corner)
      text +=
          corners[corner & 1][0] + " " + corners[corner >> 1 & 1][1] + " " + corners[corner >> 2][2] + "\n";
    text += "4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n";
    Write(name, text);
  }

  // How many pixels of a mask are the object, of how many.
  std::pair<int, int> ObjectPixels(const std::string& mask) {
    const absl::StatusOr<image::Image> picture = image::DecodePng(*ReadFile(Path(mask)));
    EXPECT_TRUE(picture.ok()) << picture.status();
    if (!picture.ok()) return {0, 0};
    int object = 0;
    for (const uint8_t pixel : picture->pixels) object += pixel != 0;
    return {object, static_cast<int>(picture->pixels.size())};
  }
};

TEST_F(PlanCommandTest, ACameraWithoutAnAimSeesTheWholeObjectWhereverItIs) {
  WriteBox("far.off", "900 -40 300", "1000 60 420");
  const std::vector<std::string> views[] = {
      {"lat20", "--approach", "0,0,-1"},
      {"far", "--mesh", "far=far.off", "--approach", "0,0,-1"},
      {"far", "--mesh", "far=far.off", "--approach=-1,0,0", "--image", "64x128"},
      {"far", "--mesh", "far=far.off", "--eye-mm", "400,300,500"}};
  for (size_t k = 0; k < std::size(views); ++k) {
    std::vector<std::string> arguments = {"capture"};
    arguments.insert(arguments.end(), views[k].begin(), views[k].end());
    const std::string name = "view" + std::to_string(k);
    for (const std::string& more : {std::string("--mask"), std::string("--renderer"), std::string("cpu"),
                                    std::string("-o"), name + ".png"})
      arguments.push_back(more);
    const Outcome outcome = Run(arguments);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    const auto [object, all] = ObjectPixels(name + ".mask.png");
    EXPECT_GT(object, all / 40) << name;
    EXPECT_LT(object, all * 9 / 10) << name;
  }
}

TEST_F(PlanCommandTest, AnObjectThatIsTooLargeForAStandoffIsSaid) {
  WriteBox("house.off", "0 0 0", "9000 9000 9000");
  const Outcome outcome =
      Run({"capture", "house", "--mesh", "house=house.off", "--approach", "0,0,-1", "-o", "house.png"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("--standoff-mm: 'house'"), HasSubstr("--eye-mm")));
}

TEST_F(PlanCommandTest, ATouchAimsAtTheObjectAndStartsOutsideOfIt) {
  WriteBox("far.off", "900 -40 300", "1000 60 420");
  WriteBox("tall.off", "-50 -50 0", "50 50 400");
  for (const std::string name : {"far", "tall"}) {
    const Outcome outcome =
        Run({"touch", name, "--mesh", name + "=" + name + ".off", "--approach", "0,0,-1", "--json"});
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    const auto touch = nlohmann::json::parse(outcome.out)["touches"][0];
    EXPECT_TRUE(touch["complete"].get<bool>()) << name;
    EXPECT_THAT(outcome.err, Not(HasSubstr("starts inside"))) << name;
    EXPECT_NEAR(touch["contact_point_mm"][2].get<double>(), name == "far" ? 420 : 400, 1e-3);
  }
}

TEST_F(PlanCommandTest, ImportCentersAndSaysByHowMuch) {
  WriteBox("far.off", "900 -40 300", "1000 60 420");
  const Outcome info = Run({"mesh", "info", "far.off"});
  EXPECT_THAT(info.out, HasSubstr("--center"));
  const Outcome outcome = Run({"mesh", "import", "far.off", "--center", "-o", "here.off", "--json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("moved every vertex by -950, -10, -360 mm"));
  const auto report = nlohmann::json::parse(outcome.out);
  EXPECT_NEAR(report["bounds_min_mm"][0].get<double>(), -50, 1e-4);
  EXPECT_NEAR(report["bounds_max_mm"][2].get<double>(), 60, 1e-4);
  EXPECT_THAT(Run({"mesh", "info", "here.off"}).out, Not(HasSubstr("--center")));
}

TEST_F(PlanCommandTest, EveryTouchOfAFacesPlanHitsAndTheDrawsAreSaid) {
  // A plate of 10 mm on edge: from four of its six faces most lines pass it.
  WriteBox("plate.off", "-75 -5 -75", "75 5 75");
  const Outcome plan =
      Run({"plan", "plate", "--mesh", "plate=plate.off", "--plan", "faces", "-o", "plan.csv"});
  ASSERT_EQ(plan.exit_code, 0) << plan.err;
  EXPECT_THAT(plan.err, AllOf(HasSubstr("plate: 192 touches took "), HasSubstr("a finger met nothing")));
  const Outcome touched = Run({"touch", "--plan", "plan.csv", "--mesh", "plate=plate.off", "-o", "set.csv"});
  ASSERT_EQ(touched.exit_code, 0) << touched.err;
  EXPECT_THAT(touched.err, Not(HasSubstr("incomplete")));
  const auto json = nlohmann::json::parse(
      Run({"plan", "plate", "--mesh", "plate=plate.off", "--plan", "faces", "--json"}).out);
  EXPECT_EQ(json["touches"].size(), 192u);
  EXPECT_GT(json["draws"]["plate"]["finger_missed"].get<int>(), 100);
}

TEST_F(PlanCommandTest, WhatNoDrawMeetsIsRefusedWithTheReason) {
  WriteBox("needle.off", "-100 -0.05 -0.05", "100 0.05 0.05");
  const Outcome plan =
      Run({"plan", "needle", "--mesh", "needle=needle.off", "--plan", "faces", "--max-draws", "40"});
  EXPECT_NE(plan.exit_code, 0);
  EXPECT_THAT(plan.err, AllOf(HasSubstr("object 'needle', touch 0: in 40 draws"), HasSubstr("met nothing"),
                              HasSubstr("200 x 0.1 x 0.1 mm")));
  EXPECT_EQ(plan.out, "");
}

TEST_F(PlanCommandTest, TheModelsFingersDecideWhatIsPlanned) {
  WriteBox("small.off", "-22 -22 -22", "22 22 22");
  Write("narrow.yaml", "touchstone: model/1\nname: narrow\nend_effector: {fingers: 3, spacing_mm: 10}\n");
  const std::vector<std::string> plan = {"plan",   "small", "--mesh",      "small=small.off",
                                         "--plan", "faces", "--max-draws", "300"};
  EXPECT_THAT(Run(plan).err, HasSubstr("in 300 draws no touch"));
  auto with_model = plan;
  with_model.insert(with_model.end(), {"--model", "narrow.yaml"});
  const Outcome outcome = Run(with_model);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
}

TEST_F(PlanCommandTest, AnImplausibleSizeIsSaidOnceWithTheUnitThatWouldBeRight) {
  WriteBox("arm.off", "0 0 0", "150 150 150");
  const Outcome info = Run({"mesh", "info", "arm.off", "--unit", "m"});
  EXPECT_THAT(info.out, HasSubstr("150000 mm, implausibly large"));
  EXPECT_THAT(info.out, HasSubstr("With unit mm instead of m it would be 150 mm"));
  WriteBox("tiny.off", "0 0 0", "0.8 0.8 0.8");
  EXPECT_THAT(Run({"mesh", "info", "tiny.off"}).out,
              HasSubstr("With unit m instead of mm it would be 800 mm"));
  const Outcome touch =
      Run({"touch", "tiny", "--mesh", "tiny=tiny.off", "--approach", "0,0,-1", "--repeats", "3"});
  const size_t note = touch.err.find("implausibly small");
  ASSERT_NE(note, std::string::npos) << touch.err;
  EXPECT_EQ(touch.err.find("implausibly small", note + 1), std::string::npos) << "once";
  EXPECT_THAT(Run({"plan", "arm", "--mesh", "arm=arm.off,unit=m", "--count", "2"}).err,
              HasSubstr("implausibly large"));
}

TEST_F(PlanCommandTest, TheClockRunsOnOverTheObjects) {
  const std::vector<std::vector<std::string>> plans = {
      {"--count", "3"},
      {"--count", "3", "--first", "4"},
      {"--plan", "faces", "--samples-per-face", "1", "--rounds", "2"}};
  for (const std::vector<std::string>& plan : plans) {
    std::vector<std::string> arguments = {"plan", "lat00,lat10", "--touch-interval-s", "2.5", "--json"};
    arguments.insert(arguments.end(), plan.begin(), plan.end());
    const auto touches = nlohmann::json::parse(Run(arguments).out)["touches"];
    ASSERT_GE(touches.size(), 6u);
    for (const auto& touch : touches) EXPECT_EQ(touch["session_time_s"], 2.5 * touch["touch"].get<int>());
  }
}

TEST_F(PlanCommandTest, AStartInsideTheObjectIsSaidByPlanAndTouch) {
  const Outcome touch =
      Run({"touch", "lat00", "--approach", "0,0,-1", "--standoff-mm", "20", "-o", "set.csv"});
  EXPECT_THAT(touch.err, AllOf(HasSubstr("touch 0 starts inside of 'lat00': a standoff of 20 mm"),
                               HasSubstr("from 70 mm on")));
  EXPECT_THAT(Run({"plan", "lat00", "--plan", "set.csv"}).err, HasSubstr("touch 0 starts inside of 'lat00'"));
}

TEST_F(PlanCommandTest, PartsFullOfHolesArePlannedWithoutAMiss) {
  for (const std::string name : {"handle", "anchor", "part"}) {
    const fs::path part = fs::path(SharedData()) / "meshes" / "cgal" / (name + ".off");
    std::error_code error;
    if (!fs::exists(part, error)) GTEST_SKIP() << "the shared mesh " << part << " is missing";
    const std::string mesh = name + "=" + part.string() + ",fit_mm=150";
    const Outcome plan = Run({"plan", name, "--mesh", mesh, "--plan", "faces", "-o", name + ".csv"});
    ASSERT_EQ(plan.exit_code, 0) << plan.err;
    EXPECT_THAT(plan.err, HasSubstr(name + ": 192 touches took "));
    const Outcome touched = Run({"touch", "--plan", name + ".csv", "--mesh", mesh, "-o", name + ".set.csv"});
    EXPECT_EQ(touched.exit_code, 0) << touched.err;
    EXPECT_THAT(touched.err, Not(HasSubstr("incomplete")));
  }
}

}  // namespace
}  // namespace touchstone::cli
