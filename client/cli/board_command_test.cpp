// `touchstone diagnose FOLDER --board`: the lens by pictures of a chessboard, on OpenCV's own thirteen photographs. They
// are real; what is known of their lens is what cv::calibrateCamera finds in them (server/diagnosis/boards/README.md).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "client/cli/real_binary_test.h"
#include "touchstone_test_paths.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

const std::string kPictures = TOUCHSTONE_SHARED_DATA "/camera/opencv_chessboard";
// cv::calibrateCamera on these pictures: k1, and the reprojection error of pictures that it did not see, px.
constexpr double kOpenCvK1 = -0.2843, kOpenCvHeldOutPx = 0.1943;

class BoardCommand : public RealBinaryTest {
 protected:
  Outcome Diagnose(std::vector<std::string> words) {
    words.insert(words.begin(), "diagnose");
    return Run(std::move(words));
  }
  void ExpectRefused(const std::vector<std::string>& words, const std::string& why) {
    const Outcome outcome = Diagnose(words);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(why));
    EXPECT_EQ(outcome.out, "");
  }
};

TEST_F(BoardCommand, NamesTheRadialDistortionOfRealPicturesAsOpenCvDoes) {
  if (!fs::exists(kPictures)) GTEST_SKIP() << kPictures << " is not here";
  const Outcome outcome = Diagnose({kPictures, "--board", "9x6", "--square-mm", "25", "--json", "report.json",
                                    "--save-model", "lens.yaml"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const nlohmann::json report = nlohmann::json::parse(Read("report.json"));
  double k1 = 0;
  const nlohmann::json* radial = nullptr;
  for (const nlohmann::json& step : report["steps"]) {
    if (step["effect"] != "radial_distortion") continue;
    radial = &step;
    for (const nlohmann::json& value : step["parameters"])
      if (value["name"] == "k1") k1 = value["value"];
  }
  ASSERT_NE(radial, nullptr) << report["summary"];
  EXPECT_NEAR(k1, kOpenCvK1, 0.02);
  EXPECT_LT(report["final"]["heldout_rmse_px"].get<double>(), 1.05 * kOpenCvHeldOutPx);
  EXPECT_GT(report["initial"]["heldout_rmse_px"].get<double>(), 1.0);
  EXPECT_LT((*radial)["rmse_px"].get<double>(), report["initial"]["rmse_px"].get<double>());
  EXPECT_NEAR(report["noise_floor"]["sigma_px"].get<double>() * std::sqrt(2.0),
              report["final"]["rmse_px"].get<double>(), 1e-9);
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("Reprojection error"), HasSubstr("+ radial_distortion"),
                                 HasSubstr("left out")));
  EXPECT_THAT(Read("lens.yaml"), HasSubstr("radial_distortion"));
}

TEST_F(BoardCommand, MessagesSayWhatIsWrong) {
  fs::create_directory(Path("empty"));
  ExpectRefused({"empty", "--board", "9x6", "--square-mm", "25"}, "empty");
  ExpectRefused({"nowhere", "--board", "9x6", "--square-mm", "25"}, "nowhere");
  ExpectRefused({"empty", "--board", "9x6"}, "--square-mm");
  ExpectRefused({"empty", "--square-mm", "25"}, "--board");
  ExpectRefused({"empty", "--board", "nine", "--square-mm", "25"}, "nine");
  ExpectRefused({"empty", "--board", "9x1", "--square-mm", "25"}, "9x1");
  ExpectRefused({"empty", "--board", "9x6", "--square-mm", "-25"}, "-25");
  ExpectRefused({"empty", "--board", "9x6", "--square-mm", "25", "--html", "page.html"}, "--html");
}

TEST_F(BoardCommand, PicturesOfAnotherBoardAreNoDataAndNotAVerdict) {
  if (!fs::exists(kPictures)) GTEST_SKIP() << kPictures << " is not here";
  // One picture will do: the search for corners that are not there takes seconds a picture.
  fs::create_directory(Path("photos"));
  fs::copy_file(kPictures + "/left01.jpg", Path("photos/left01.jpg"));
  const Outcome outcome = Diagnose({"photos", "--board", "8x8", "--square-mm", "25"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("Too few pictures"), HasSubstr("8x8"), HasSubstr("left01.jpg"),
                                 Not(HasSubstr("radial_distortion"))));
}

}  // namespace
}  // namespace touchstone::cli
