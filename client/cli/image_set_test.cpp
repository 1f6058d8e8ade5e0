#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "client/cli/image_set.h"
#include "server/base/test_folder.h"

namespace touchstone::cli {
namespace {

using testing::HasSubstr;

class ImageSetTest : public testing::Test {
 protected:
  std::string Path(const std::string& file) const { return folder_.Path("set/" + file); }
  std::string Folder() const { return folder_.Path("set"); }
  std::string Text(const std::string& file) const {
    std::ifstream in(Path(file));
    std::ostringstream text;
    text << in.rdbuf();
    return text.str();
  }
  void Picture(const std::string& file) const { std::ofstream(Path(file)) << "png"; }
  static ImageSetRow Row(const std::string& file, double unix_s, bool measured = true) {
    ImageSetRow row;
    row.file = file, row.object = "lat20";
    row.commanded.mutable_eye_m()->set_z(0.25);
    row.commanded.mutable_up()->set_y(1);
    row.photograph.set_unix_s(unix_s);
    if (measured) {
      *row.photograph.mutable_measured() = row.commanded;
      row.photograph.mutable_measured()->mutable_eye_m()->set_x(0.0001234);
    }
    return row;
  }

  const TestFolder folder_;
  const ImageSetCamera camera_{640, 480, 0.7853981633974483};
};

TEST_F(ImageSetTest, HasBothPosesOfEveryPictureInMillimetres) {
  auto set = ImageSet::Open(Folder(), camera_);
  ASSERT_TRUE(set.ok()) << set.status();
  ASSERT_TRUE(set->Add(Row("b.png", 1000.5)).ok());
  ASSERT_TRUE(set->Add(Row("a.png", 1002.0, false)).ok());
  const std::string text = Text("images.csv");
  EXPECT_THAT(text, testing::StartsWith("image,file,object,eye_x_mm,"));
  EXPECT_THAT(text, HasSubstr("\n1,a.png,lat20,0.000000,0.000000,250.000000,0.000000,0.000000,0.000000,"
                              "0.000000000,1.000000000,0.000000000,1.500,,,,,,,,,,1002.000\n"));
  EXPECT_THAT(text, HasSubstr("\n2,b.png,lat20,0.000000,0.000000,250.000000,0.000000,0.000000,0.000000,"
                              "0.000000000,1.000000000,0.000000000,0.000,0.123400,0.000000,250.000000,"));
}

TEST_F(ImageSetTest, CameraIsAnIdealPinhole) {
  ASSERT_TRUE(ImageSet::Open(Folder(), camera_).ok());
  // 240 / tan(22.5 deg)
  EXPECT_EQ(
      Text("camera.yaml"),
      "{width_px: 640, height_px: 480, fx_px: 579.411255, fy_px: 579.411255, cx_px: 320, cy_px: 240}\n");
}

TEST_F(ImageSetTest, IsResumedWithItsRows) {
  {
    auto set = ImageSet::Open(Folder(), camera_);
    ASSERT_TRUE(set->Add(Row("a.png", 1000)).ok());
    ASSERT_TRUE(set->Add(Row("b.png", 1001)).ok());
    Picture("a.png");
  }
  auto set = ImageSet::Open(Folder(), camera_);
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_TRUE(*set->Has("a.png"));
  EXPECT_FALSE(*set->Has("b.png")) << "its picture was not written";
  EXPECT_FALSE(*set->Has("c.png"));
  ASSERT_TRUE(set->Add(Row("c.png", 1010)).ok());
  EXPECT_THAT(Text("images.csv"),
              testing::AllOf(HasSubstr("1,a.png,"), HasSubstr("3,c.png,"), HasSubstr(",10.000,")));
}

TEST_F(ImageSetTest, APictureWithoutARowIsNotTakenForOneOfTheSet) {
  auto set = ImageSet::Open(Folder(), camera_);
  Picture("a.png");
  EXPECT_EQ(set->Has("a.png").status().code(), absl::StatusCode::kFailedPrecondition);
}

TEST_F(ImageSetTest, AFolderOfAnotherCameraOrFormatIsRefused) {
  ASSERT_TRUE(ImageSet::Open(Folder(), camera_).ok());
  EXPECT_EQ(ImageSet::Open(Folder(), {320, 240, 0.78}).status().code(),
            absl::StatusCode::kFailedPrecondition);
  std::ofstream(Path("images.csv")) << "file,x\na.png,1\n";
  const auto other = ImageSet::Open(Folder(), camera_);
  EXPECT_EQ(other.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(other.status().message()), HasSubstr("images.csv:1"));
}

}  // namespace
}  // namespace touchstone::cli
