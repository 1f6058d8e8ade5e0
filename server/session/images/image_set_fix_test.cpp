#include "server/session/images/image_set_fix.h"

#include <gtest/gtest.h>

namespace touchstone::session {
namespace {

// Three grey pictures of 3 x 2 pixels, numbered from the top left, each 10 more than the last.
ImageSet SmallSet() {
  ImageSet set;
  set.origin = "photos";
  set.camera = {3, 2, 30, 40, 1.25, 0.75};
  set.objects = {"cup", "star"};
  for (int k = 0; k < 3; ++k) {
    PhotographRow row;
    row.image = k;
    row.file = "p" + std::to_string(k) + ".png";
    row.object = k == 2 ? 1 : 0;
    row.commanded.eye_m = {0.3, 0.1 * k, 0.2};
    row.line = 2 + k;
    for (int pixel = 0; pixel < 6; ++pixel) row.pixels.push_back(static_cast<uint8_t>(10 * k + pixel));
    set.photographs.push_back(row);
  }
  return set;
}

constexpr char kCsv[] =
    "image,file,object,eye_x_mm,eye_y_mm,eye_z_mm,at_x_mm,at_y_mm,at_z_mm,up_x,up_y,up_z,cov_note\n"
    "0,p0.png,cup,300.00,0,200,0,0,0,0,0,1,7.50\n"
    "1,p1.png,cup,300.00,100,200,0,0,0,0,0,1,7.50\n"
    "2,p2.png,star,300.00,200,200,0,0,0,0,0,1,7.50\n";

TEST(ImageSetFix, AQuarterTurnIsClockwiseAndTakesTheCameraAlong) {
  ImageSet set = SmallSet();
  ImageSetFix fix;
  fix.rotate_deg = 90;
  ASSERT_TRUE(ApplyFix(fix, &set).ok());
  //  0 1 2      3 0
  //  3 4 5  ->  4 1
  //             5 2
  EXPECT_EQ(set.photographs[0].pixels, (std::vector<uint8_t>{3, 0, 4, 1, 5, 2}));
  EXPECT_EQ(set.camera.width_px, 2);
  EXPECT_EQ(set.camera.height_px, 3);
  EXPECT_EQ(set.camera.fx_px, 40);
  EXPECT_EQ(set.camera.cx_px, 2 - 0.75);
  EXPECT_EQ(set.camera.cy_px, 1.25);
}

TEST(ImageSetFix, TurnsAndMirrorsUndoThemselves) {
  const ImageSet set = SmallSet();
  for (const auto& [there, back] : {std::pair{90, 270}, {180, 180}, {270, 90}}) {
    ImageSet turned = set;
    ImageSetFix first, second;
    first.rotate_deg = there, second.rotate_deg = back;
    ASSERT_TRUE(ApplyFix(first, &turned).ok());
    EXPECT_NE(turned.photographs[1].pixels, set.photographs[1].pixels);
    ASSERT_TRUE(ApplyFix(second, &turned).ok());
    EXPECT_EQ(turned.photographs[1].pixels, set.photographs[1].pixels);
    EXPECT_EQ(turned.camera.cx_px, set.camera.cx_px);
    EXPECT_EQ(turned.camera.fy_px, set.camera.fy_px);
  }
  ImageSetFix mirror;
  mirror.mirror = ImageSetFix::Mirror::kLeftRight;
  ImageSet mirrored = set;
  ASSERT_TRUE(ApplyFix(mirror, &mirrored).ok());
  EXPECT_EQ(mirrored.photographs[0].pixels, (std::vector<uint8_t>{2, 1, 0, 5, 4, 3}));
}

TEST(ImageSetFix, ShiftedRowsTakeTheirPicturesAndLeaveTheirPoses) {
  ImageSet set = SmallSet();
  ImageSetFix fix;
  fix.shift_rows = 1;
  const absl::StatusOr<std::vector<int>> left = ApplyFix(fix, &set);
  ASSERT_TRUE(left.ok());
  EXPECT_EQ(*left, (std::vector<int>{1, 2}));
  EXPECT_EQ(set.photographs[0].file, "p0.png");
  EXPECT_EQ(set.photographs[0].pixels[0], 0);
  EXPECT_EQ(set.photographs[0].commanded.eye_m.y(), 0.1);
}

TEST(ImageSetFix, FieldsThatStayKeepTheirBytes) {
  ImageSetFix fix;
  fix.rename_objects = {{"cup", "star"}, {"star", "cup"}};
  const absl::StatusOr<FixedImageSet> fixed = FixImageSet(SmallSet(), kCsv, "camera as it was\n", fix);
  ASSERT_TRUE(fixed.ok()) << fixed.status();
  EXPECT_EQ(fixed->images_csv,
            "image,file,object,eye_x_mm,eye_y_mm,eye_z_mm,at_x_mm,at_y_mm,at_z_mm,up_x,up_y,up_z,cov_note\n"
            "0,p0.png,star,300.00,0,200,0,0,0,0,0,1,7.50\n"
            "1,p1.png,star,300.00,100,200,0,0,0,0,0,1,7.50\n"
            "2,p2.png,cup,300.00,200,200,0,0,0,0,0,1,7.50\n");
  EXPECT_EQ(fixed->camera_yaml, "camera as it was\n");
  EXPECT_TRUE(fixed->changed_pixels.empty());
}

TEST(ImageSetFix, PicturesAreExchangedOrDroppedByTheirNumbers) {
  ImageSetFix exchange;
  exchange.exchange = {0, 2};
  absl::StatusOr<FixedImageSet> fixed = FixImageSet(SmallSet(), kCsv, "camera as it was\n", exchange);
  ASSERT_TRUE(fixed.ok()) << fixed.status();
  EXPECT_EQ(fixed->images_csv,
            "image,file,object,eye_x_mm,eye_y_mm,eye_z_mm,at_x_mm,at_y_mm,at_z_mm,up_x,up_y,up_z,cov_note\n"
            "0,p2.png,cup,300.00,0,200,0,0,0,0,0,1,7.50\n"
            "1,p1.png,cup,300.00,100,200,0,0,0,0,0,1,7.50\n"
            "2,p0.png,star,300.00,200,200,0,0,0,0,0,1,7.50\n");
  EXPECT_EQ(FixOptions(exchange), "--exchange 0,2");
  ImageSetFix drop;
  drop.drop = {1};
  fixed = FixImageSet(SmallSet(), kCsv, "camera as it was\n", drop);
  ASSERT_TRUE(fixed.ok()) << fixed.status();
  ASSERT_EQ(fixed->set.size(), 2u);
  EXPECT_EQ(fixed->images_csv.find("p1.png"), std::string::npos);
  EXPECT_EQ(FixOptions(drop), "--drop-images 1");
}

TEST(ImageSetFix, ReversesUp) {
  ImageSet set = SmallSet();
  const Eigen::Vector3d up = set.photographs[1].commanded.up;
  ImageSetFix fix;
  fix.reverse_up = true;
  fix.images = {{1, 1}};
  ASSERT_TRUE(ApplyFix(fix, &set).ok());
  EXPECT_EQ(set.photographs[1].commanded.up, -up);
  EXPECT_EQ(set.photographs[0].commanded.up, up);
}

TEST(ImageSetFix, RefusesWhatTheSetDoesNotHave) {
  ImageSet set = SmallSet();
  ImageSetFix grey;
  grey.swap_channels = true;
  EXPECT_FALSE(ApplyFix(grey, &set).ok());
  ImageSetFix unknown;
  unknown.rename_objects = {{"mug", "cup"}};
  EXPECT_NE(ApplyFix(unknown, &set).status().message().find("mug"), absl::string_view::npos);
  ImageSetFix far;
  far.shift_rows = 3;
  EXPECT_FALSE(ApplyFix(far, &set).ok());
  ImageSetFix nobody;
  nobody.mirror = ImageSetFix::Mirror::kUpDown;
  nobody.images = {{40, 50}};
  EXPECT_FALSE(ApplyFix(nobody, &set).ok());
  ImageSetFix absent;
  absent.exchange = {0, 40};
  EXPECT_NE(ApplyFix(absent, &set).status().message().find("image 40"), absl::string_view::npos);
  ImageSetFix itself;
  itself.exchange = {1, 1};
  EXPECT_FALSE(ApplyFix(itself, &set).ok());
  ImageSetFix all;
  all.drop = {0, 1, 2};
  EXPECT_FALSE(ApplyFix(all, &set).ok());
}

}  // namespace
}  // namespace touchstone::session
