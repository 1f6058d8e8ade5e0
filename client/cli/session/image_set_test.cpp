#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "client/cli/session/image_set.h"
#include "server/base/test_folder.h"
#include "server/image/encoding/encode.h"
#include "server/session/images/camera_yaml.h"
#include "server/session/images/emulated.h"
#include "server/session/images/image_set_file.h"
#include "server/session/images/images_csv.h"

namespace touchstone::cli {
namespace {

using testing::HasSubstr;
using testing::Not;

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

TEST_F(ImageSetTest, IsReadAsEveryOtherImageSetWithBothPosesOfEveryPicture) {
  auto set = ImageSet::Open(Folder(), camera_);
  ASSERT_TRUE(set.ok()) << set.status();
  ASSERT_TRUE(set->Add(Row("b.png", 1000.5)).ok());
  ImageSetRow repeat = Row("a.png", 1002.0, false);
  repeat.round = 1, repeat.emulated = true;
  ASSERT_TRUE(set->Add(repeat).ok());
  const std::vector<uint8_t> grey(640 * 480, 7);
  for (const char* file : {"a.png", "b.png"})
    std::ofstream(Path(file), std::ios::binary) << *image::EncodePng(grey.data(), 640, 480, 1);
  const auto read = session::ReadImageSet(Folder());
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->size(), 2u);
  const session::PhotographRow &first = read->photographs[0], &second = read->photographs[1];
  EXPECT_EQ(first.file, "b.png");
  EXPECT_EQ(first.commanded.eye_m, Eigen::Vector3d(0, 0, 0.25));
  ASSERT_TRUE(first.measured.has_value());
  EXPECT_EQ(first.measured->eye_m, Eigen::Vector3d(0.0001234, 0, 0.25));
  EXPECT_EQ(first.session_time_s, 0);
  EXPECT_EQ(first.round, 0);
  EXPECT_FALSE(second.measured.has_value());
  EXPECT_EQ(second.session_time_s, 1.5);
  EXPECT_EQ(second.round, 1);
  EXPECT_EQ(session::CountEmulated(*read), 1);
  // One writer: what it writes is what the session format writes.
  EXPECT_EQ(Text("images.csv"), session::FormatImagesCsv(*read));
  EXPECT_EQ(Text("camera.yaml"), session::FormatCameraYaml(read->camera));
}

TEST_F(ImageSetTest, CameraIsAnIdealPinhole) {
  ASSERT_TRUE(ImageSet::Open(Folder(), camera_).ok());
  const auto camera = session::ParseCameraYaml(Text("camera.yaml"), "camera.yaml");
  ASSERT_TRUE(camera.ok()) << camera.status();
  EXPECT_EQ(camera->width_px, 640);
  EXPECT_EQ(camera->height_px, 480);
  EXPECT_NEAR(camera->fx_px, 579.4112549695428, 1e-9);  // 240 / tan(22.5 deg)
  EXPECT_EQ(camera->fx_px, camera->fy_px);
  EXPECT_EQ(camera->cx_px, 320);
  EXPECT_EQ(camera->cy_px, 240);
  EXPECT_EQ(camera->k1, 0);
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
              testing::AllOf(HasSubstr("1,a.png,"), HasSubstr("3,c.png,"), HasSubstr(",10,0,")));
  // A row whose picture was never written is replaced.
  ASSERT_TRUE(set->Add(Row("b.png", 1020)).ok());
  EXPECT_EQ(set->size(), 3u);
  EXPECT_THAT(Text("images.csv"), testing::AllOf(Not(HasSubstr("2,b.png,")), HasSubstr("4,b.png,")));
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
  // An image set of another's making does not say when its pictures were taken.
  std::ofstream(Path("images.csv"))
      << "image,file,object,eye_x_mm,eye_y_mm,eye_z_mm,at_x_mm,at_y_mm,at_z_mm,up_x,up_y,up_z\n"
         "1,a.png,lat20,0,0,250,0,0,0,0,1,0\n";
  const auto foreign = ImageSet::Open(Folder(), camera_);
  EXPECT_THAT(std::string(foreign.status().message()), HasSubstr("images.csv:2: has no cov_unix_s"));
}

}  // namespace
}  // namespace touchstone::cli
