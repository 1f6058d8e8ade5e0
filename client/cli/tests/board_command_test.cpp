// touchstone diagnose --board on the command line: real pictures, and what is refused.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "client/cli/tests/real_binary_test.h"
#include "server/base/sanitizers.h"
#include "server/base/test_paths.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

// OpenCV's chessboard pictures; TOUCHSTONE_CHESSBOARD names another folder of them.
std::string Chessboards() {
  const char* other = std::getenv("TOUCHSTONE_CHESSBOARD");
  return other != nullptr ? other : SharedData() + "/camera/opencv_chessboard";
}
// OpenCV's own calibration of the same corners, and its error on left-out pictures: board_pictures_test.cpp computes both.
constexpr double kOpenCvK1 = -0.2843, kOpenCvHeldoutPx = 0.1943;

class BoardCommand : public RealBinaryTest {
 protected:
  // The error of a command that must be refused.
  std::string Refused(std::vector<std::string> more) {
    std::vector<std::string> command = {"diagnose"};
    command.insert(command.end(), more.begin(), more.end());
    const Outcome outcome = Run(command);
    EXPECT_NE(outcome.exit_code, 0) << outcome.out;
    EXPECT_LT(outcome.exit_code, 128) << outcome.err;
    EXPECT_EQ(outcome.out, "");
    return outcome.err;
  }
  // `count` of OpenCV's pictures.
  void CopyBoards(const std::string& name, size_t count) {
    fs::create_directories(Path(name));
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(Chessboards()))
      if (entry.path().extension() == ".jpg") files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    ASSERT_GE(files.size(), count);
    for (size_t i = 0; i < count; ++i) fs::copy_file(files[i], fs::path(Path(name)) / files[i].filename());
  }
};

TEST_F(BoardCommand, RealPicturesNameRadialDistortionInPixels) {
  if (!fs::exists(Chessboards())) GTEST_SKIP() << Chessboards() << " is not there";
  if (kUnderSanitizers) GTEST_SKIP() << "diagnosis_boards_test runs the same search";
  const Outcome outcome = Run({"diagnose", Chessboards(), "--board", "9x6", "--square-mm", "25", "--json",
                               "report.json", "--save-model", "lens.yaml", "--save-camera", "camera.yaml"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("Reprojection error"), HasSubstr("+ radial_distortion"),
                                 HasSubstr("px a coordinate)")));
  const nlohmann::json report = nlohmann::json::parse(Read("report.json"), nullptr, false);
  const nlohmann::json* radial = nullptr;
  for (const nlohmann::json& step : report["steps"])
    if (step["effect"] == "radial_distortion") radial = &step;
  const nlohmann::json data = report["data"][0];
  EXPECT_EQ(data["kind"], "BOARDS");
  EXPECT_EQ(data["unit"], "px");
  ASSERT_EQ(data["after_step"].size(), report["steps"].size());
  for (const nlohmann::json& after : data["after_step"]) EXPECT_GT(after["heldout_rmse"].get<double>(), 0);
  ASSERT_NE(radial, nullptr) << outcome.out;
  EXPECT_NEAR((*radial)["parameters"][0]["value"].get<double>(), kOpenCvK1, 0.02);
  const auto px = [&](const char* of, const char* what) { return data[of][what].get<double>(); };
  EXPECT_LT(px("final", "heldout_rmse"), 1.05 * kOpenCvHeldoutPx);
  EXPECT_GT(px("initial", "heldout_rmse"), 3 * kOpenCvHeldoutPx);
  EXPECT_NEAR(data["after_step"].back()["rmse"].get<double>(), px("final", "rmse"), 1e-9);
  EXPECT_LT(px("initial", "lack_of_fit_p"), 1e-3);
  // What the fits of poses and lens take away is less than a tenth.
  EXPECT_NEAR(data["noise_floor"].get<double>(), px("final", "rmse"), 0.1 * px("final", "rmse"));
  EXPECT_THAT(Read("lens.yaml"), HasSubstr("radial_distortion"));
  // The lens in pixels: in words, in the report and as a file.
  EXPECT_THAT(outcome.out, HasSubstr("The lens:"));
  const double fx_px = data["lens"]["fx_px"].get<double>();
  EXPECT_NEAR(fx_px, 535, 10);
  EXPECT_GT(data["lens"]["fx_std_error_px"].get<double>(), 0);
  EXPECT_NEAR(data["lens"]["k1"].get<double>(), kOpenCvK1, 0.02);
  EXPECT_THAT(Read("camera.yaml"),
              AllOf(HasSubstr("width_px: 640"), HasSubstr("fx_px: 53"), HasSubstr("k1: -0.2")));
}

TEST_F(BoardCommand, TooFewBoardsGiveNoVerdictAndNoErrors) {
  if (!fs::exists(Chessboards())) GTEST_SKIP() << Chessboards() << " is not there";
  CopyBoards("two", 2);
  const Outcome two = Run({"diagnose", "two", "--board", "9x6", "--square-mm", "25", "--json", "two.json"});
  EXPECT_EQ(two.exit_code, 0) << two.err;
  EXPECT_THAT(two.out, HasSubstr("found in 2 pictures; 5 are needed"));
  const nlohmann::json report = nlohmann::json::parse(Read("two.json"), nullptr, false);
  EXPECT_EQ(report["verdict"], "TOO_LITTLE_DATA");
  EXPECT_TRUE(report["steps"].empty());
  // Files have every field that others rely on, zero where nothing was found.
  for (const char* quality : {"initial", "final"})
    EXPECT_EQ(report["data"][0][quality]["rmse"], 0) << quality;
  // Inner corners, not squares.
  const Outcome none = Run({"diagnose", "two", "--board", "10x7", "--square-mm", "25"});
  EXPECT_EQ(none.exit_code, 0) << none.err;
  EXPECT_THAT(none.out, AllOf(HasSubstr("found in 0 pictures"), HasSubstr("Is 10x7 the number of its")));
}

TEST_F(BoardCommand, OnePictureSixTimesGivesNoLens) {
  if (!fs::exists(Chessboards())) GTEST_SKIP() << Chessboards() << " is not there";
  CopyBoards("one", 1);
  const fs::path picture = fs::directory_iterator(Path("one"))->path();
  for (int copy = 0; copy < 5; ++copy)
    fs::copy_file(picture, fs::path(Path("one")) / ("copy" + std::to_string(copy) + ".jpg"));
  const Outcome outcome = Run({"diagnose", "one", "--board", "9x6", "--square-mm", "25", "--json", "one.json",
                               "--save-camera", "camera.yaml"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  const nlohmann::json report = nlohmann::json::parse(Read("one.json"), nullptr, false);
  EXPECT_EQ(report["verdict"], "TOO_LITTLE_DATA");
  EXPECT_TRUE(report["steps"].empty());
  EXPECT_THAT(outcome.out, HasSubstr("the same picture as another, counted once"));
  EXPECT_FALSE(fs::exists(Path("camera.yaml")));
}

TEST_F(BoardCommand, WhatCannotBeIsRefusedByName) {
  EXPECT_THAT(Refused({"absent", "--board", "9x6", "--square-mm", "25"}),
              AllOf(HasSubstr("absent"), HasSubstr("a folder of pictures was expected")));
  fs::create_directories(Path("empty"));
  EXPECT_THAT(Refused({"empty", "--board", "9x6", "--square-mm", "25"}), HasSubstr("holds no picture"));
  Write("empty/a.png", "no picture");
  EXPECT_THAT(Refused({"empty", "--board", "9x6", "--square-mm", "25"}), HasSubstr("a.png: cannot be read"));
  for (const char* size : {"9", "9x2", "9x6x3", "1000x6", "-9x6", "nine"})
    EXPECT_THAT(Refused({"empty", "--board", size, "--square-mm", "25"}), HasSubstr("--board: ")) << size;
  for (const char* side : {"-25", "nan", "1e9", "inf"})
    EXPECT_THAT(Refused({"empty", "--board", "9x6", "--square-mm", side}), HasSubstr("--square-mm: "))
        << side;
  EXPECT_THAT(Refused({"empty", "--board", "9x6"}), HasSubstr("Give --square-mm"));
  EXPECT_THAT(Refused({"empty", "--square-mm", "25"}), HasSubstr("Give --board"));
}

TEST_F(BoardCommand, OptionsThatABoardDoesNotHaveAreRefused) {
  fs::create_directories(Path("empty"));
  const std::vector<std::pair<std::string, std::string>> options = {
      {"--html", "page.html"},   {"--server", "127.0.0.1:1"}, {"--also", "more.yaml"},
      {"--mesh", "cup=cup.off"}, {"--mesh-dir", "empty"},     {"--keep-as", "lens"}};
  for (const auto& [name, value] : options) {
    if (name == "--also") Write(value, "effects: []\n");
    if (name == "--mesh") Write("cup.off", "OFF\n");
    EXPECT_THAT(Refused({"empty", "--board", "9x6", "--square-mm", "25", name, value}), HasSubstr(name))
        << name;
  }
  EXPECT_THAT(Refused({"empty", "--board", "9x6", "--square-mm", "25", "--with-formula"}),
              HasSubstr("--with-formula"));
  EXPECT_FALSE(fs::exists(Path("page.html")));
}

}  // namespace
}  // namespace touchstone::cli
