#include "server/diagnosis/checks/photographs/photo_mistakes.h"

#include <gtest/gtest.h>

#include "server/base/test_tier.h"
#include "server/diagnosis/images/photo_test_set.h"
#include "server/session/measurements/measurement_fix.h"

namespace touchstone::diagnosis::checks {
namespace {

using engine::ProblemKind;

using session::ImageSetFix;

images::HiddenCamera SmallCamera() {
  images::HiddenCamera rig;
  rig.photographs = 6;
  rig.side_px = 96;
  return rig;
}

DiagnosisInput Corrupted(const DiagnosisInput& input, const ImageSetFix& mistake) {
  DiagnosisInput corrupted = input;
  auto set = std::make_shared<session::ImageSet>(*input.images);
  EXPECT_TRUE(session::ApplyFix(mistake, set.get()).ok());
  corrupted.images = set;
  return corrupted;
}

std::vector<PhotoMistake> Found(const DiagnosisInput& input) {
  return FindPhotoMistakes(input, DiagnosisContext());
}

// Some of what is found has this kind, and its fix gives the pictures and poses back as they were.
void ExpectFound(const ImageSetFix& mistake, ProblemKind kind) {
  SCOPED_TRACE(session::FixOptions(mistake));
  const DiagnosisInput input = images::MakePhotoInput(SmallCamera());
  const DiagnosisInput corrupted = Corrupted(input, mistake);
  const std::vector<PhotoMistake> found = Found(corrupted);
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found[0].problem.kind, kind);
  bool restored = false;
  for (const PhotoMistake& claim : found) {
    auto set = std::make_shared<session::ImageSet>(*corrupted.images);
    ASSERT_TRUE(session::ApplyFix(claim.fix, set.get()).ok());
    EXPECT_LT(claim.left_after, 0.5 * claim.left_before);
    restored |=
        set->photographs[0].pixels == input.images->photographs[0].pixels &&
        (set->photographs[0].commanded.eye_m - input.images->photographs[0].commanded.eye_m).norm() < 1e-9 &&
        std::abs(set->camera.fx_px - input.images->camera.fx_px) < 1e-9;
  }
  EXPECT_TRUE(restored);
}

TEST(PhotoMistakes, MirroredAndTurnedPicturesAreFound) {
  ImageSetFix mistake;
  mistake.mirror = ImageSetFix::Mirror::kLeftRight;
  ExpectFound(mistake, ProblemKind::kMirrored);
  mistake.mirror = ImageSetFix::Mirror::kUpDown;
  ExpectFound(mistake, ProblemKind::kMirrored);
  for (const int turn_deg : {90, 180, 270}) {
    ImageSetFix turned;
    turned.rotate_deg = turn_deg;
    ExpectFound(turned, ProblemKind::kRotated);
  }
}

TEST(PhotoMistakes, AnotherCameraAndOtherLengthsAreFound) {
  TOUCHSTONE_SECOND_TIER("repeated: five factors of lengths and of focal lengths");
  for (const double factor : {0.5, 2.0, 1.5}) {
    ImageSetFix focal;
    focal.scale_focal = factor;
    ExpectFound(focal, ProblemKind::kFocalFactor);
    ImageSetFix camera;
    camera.scale_camera = factor;
    ExpectFound(camera, ProblemKind::kFocalFactor);
  }
  for (const double factor : {0.001, 1 / 25.4}) {
    ImageSetFix lengths;
    lengths.scale_lengths = factor;
    ExpectFound(lengths, ProblemKind::kUnitsLength);
  }
}

TEST(PhotoMistakes, PosesOfAnotherFrameAreFound) {
  ImageSetFix axes;
  axes.axes = *session::ParseAxes("x,-z,y");
  ExpectFound(axes, ProblemKind::kUpAxis);
  ImageSetFix exchanged;
  exchanged.swap_eye_at = true;
  ExpectFound(exchanged, ProblemKind::kEyeAt);
}

TEST(PhotoMistakes, ReversedUpIsFound) {
  ImageSetFix reversed;
  reversed.reverse_up = true;
  const DiagnosisInput input = images::MakePhotoInput(SmallCamera());
  const std::vector<PhotoMistake> found = Found(Corrupted(input, reversed));
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found[0].problem.kind, ProblemKind::kUpAxis);
  EXPECT_TRUE(found[0].fix.reverse_up);
}

TEST(PhotoMistakes, TwoExchangedPicturesAreFound) {
  const DiagnosisInput input = images::MakePhotoInput(SmallCamera());
  ImageSetFix exchange;
  exchange.exchange = {2, 4};
  const std::vector<PhotoMistake> found = Found(Corrupted(input, exchange));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].problem.kind, ProblemKind::kExchanged);
  EXPECT_EQ(found[0].fix.exchange, exchange.exchange);
  EXPECT_NE(found[0].problem.fix.find("--exchange 2,4"), std::string::npos);
}

// The camera gave the picture of the row before, and in row 9 that of two rows before: too many rows for odd ones.
TEST(PhotoMistakes, PicturesOfTheViewBeforeAreNamed) {
  const DiagnosisInput input = images::MakePhotoInput(SmallCamera());
  DiagnosisInput stale = input;
  auto set = std::make_shared<session::ImageSet>(*input.images);
  for (const auto& [row, shown] : {std::pair{3, 2}, {8, 7}, {9, 7}, {14, 13}})
    set->photographs[row].pixels = input.images->photographs[shown].pixels;
  stale.images = set;
  const std::vector<PhotoMistake> found = Found(stale);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].problem.kind, ProblemKind::kStaleRows);
  EXPECT_EQ(found[0].problem.detail, "images 3, 8, 9, 14");
  EXPECT_NE(found[0].problem.fix.find("--drop-images 3,8,9,14"), std::string::npos) << found[0].problem.fix;
  EXPECT_LT(found[0].left_after, 0.1 * found[0].left_before);
}

TEST(PhotoMistakes, OnePictureWithReversedUpIsFound) {
  const DiagnosisInput input = images::MakePhotoInput(SmallCamera());
  ImageSetFix one;
  one.images = {{3, 3}};
  one.reverse_up = true;
  const std::vector<PhotoMistake> found = Found(Corrupted(input, one));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].problem.detail, "image 3");
  EXPECT_EQ(found[0].fix.images, one.images);
}

TEST(PhotoMistakes, APictureWithAThumbInItIsNamed) {
  images::HiddenCamera rig = SmallCamera();
  rig.unlisted = [](int photograph, int column, int row, const image::Photo& photo, size_t pixel) {
    const double x = column - 90.0, y = row - 80.0;
    const bool thumb = photograph == 5 && x * x + y * y < 30 * 30;
    return thumb ? 150.0 - photo.grey[pixel] : 0.0;
  };
  const std::vector<PhotoMistake> found = Found(images::MakePhotoInput(rig));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].problem.kind, ProblemKind::kOddPicture);
  EXPECT_EQ(found[0].problem.detail, "image 5");
  EXPECT_NE(found[0].problem.fix.find("--drop-images 5"), std::string::npos);
}

TEST(PhotoMistakes, ShiftedRowsAndExchangedNamesAreFound) {
  const DiagnosisInput input = images::MakePhotoInput(SmallCamera());
  ImageSetFix shift;
  shift.shift_rows = 1;
  std::vector<PhotoMistake> found = Found(Corrupted(input, shift));
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found[0].problem.kind, ProblemKind::kRowShift);
  EXPECT_EQ(found[0].fix.shift_rows, -1);
  ImageSetFix names;
  names.rename_objects = {{"lat00", "lat20"}, {"lat20", "lat00"}};
  found = Found(Corrupted(input, names));
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found[0].problem.kind, ProblemKind::kObjectNames);
  EXPECT_EQ(found[0].problem.detail, "lat00 <-> lat20");
}

TEST(PhotoMistakes, AnObjectOfAnotherMeshIsFound) {
  const DiagnosisInput input = images::MakePhotoInput(SmallCamera());
  ImageSetFix wrong;
  wrong.rename_objects = {{"lat20", "cup"}};
  DiagnosisInput corrupted = Corrupted(input, wrong);
  corrupted.surfaces["cup"] = images::PhotoTestSurface("lat05");
  const std::vector<PhotoMistake> found = Found(corrupted);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].problem.kind, ProblemKind::kWrongObject);
  EXPECT_EQ(found[0].problem.detail, "cup -> lat20");
}

TEST(PhotoMistakes, RadiansInTheModelAreFound) {
  images::HiddenCamera rig = SmallCamera();
  rig.hidden = {{"camera_rotation", {"rotation_deg=1.5,-1,2"}}};
  DiagnosisInput input = images::MakePhotoInput(rig);
  input.model = std::make_shared<const model::Model>(images::WithPhotoEffects(
      *input.model, {{"camera_rotation", {"rotation_deg=0.02617994,-0.01745329,0.03490659"}}}));
  const std::vector<PhotoMistake> found = Found(input);
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found[0].problem.kind, ProblemKind::kUnitsAngle);
  EXPECT_NE(found[0].problem.fix.find("rotation_deg=1.5,-1,2"), std::string::npos) << found[0].problem.fix;
}

TEST(PhotoMistakes, StrongPhysicsIsNoMistake) {
  TOUCHSTONE_SECOND_TIER("statistical: every effect of photographs");
  for (const images::NamedValues& hidden :
       std::vector<images::NamedValues>{{},
                                        {{"exposure", {"stops=1"}}},
                                        {{"gamma", {"exponent=0.5"}}},
                                        {{"focal_error", {"relative=0.06"}}},
                                        {{"radial_distortion", {"k1=-0.3"}}},
                                        {{"camera_rotation", {"rotation_deg=2,2,3"}}},
                                        {{"camera_translation", {"offset_mm=5,-5,10"}}},
                                        {{"object_pose", {"translation_mm=3,0,2", "rotation_deg=0,0,8"}}},
                                        {{"light_position", {"offset_mm=60,-40,0"}}},
                                        {{"ambient_light", {"level=0.2"}}},
                                        {{"background_level", {"grey=60"}}},
                                        {{"defocus_blur", {"sigma_px=3"}}},
                                        {{"vignetting", {"strength=0.5"}}},
                                        {{"specular", {"strength=0.5", "exponent=10"}}},
                                        {{"principal_point", {"offset_px=6,-4"}}}}) {
    SCOPED_TRACE(hidden.empty() ? "nothing" : hidden[0].first);
    images::HiddenCamera rig = SmallCamera();
    rig.hidden = hidden;
    const std::vector<PhotoMistake> found = Found(images::MakePhotoInput(rig));
    EXPECT_TRUE(found.empty()) << found[0].problem.words;
  }
}

TEST(PhotoMistakes, AMistakeIsFoundBesideMissingPhysics) {
  images::HiddenCamera rig = SmallCamera();
  rig.hidden = {{"exposure", {"stops=0.4"}}, {"camera_rotation", {"rotation_deg=0.5,0,0.5"}}};
  ImageSetFix mistake;
  mistake.rotate_deg = 90;
  const std::vector<PhotoMistake> found = Found(Corrupted(images::MakePhotoInput(rig), mistake));
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found[0].problem.kind, ProblemKind::kRotated);
  EXPECT_EQ(found[0].fix.rotate_deg, 270);
}

// Tinted pictures of three channels; those numbered from 12 on have red and blue the other way round.
TEST(PhotoMistakes, ChannelsAreFoundOnlyWherePicturesDisagree) {
  DiagnosisInput input = images::MakePhotoInput(SmallCamera());
  auto set = std::make_shared<session::ImageSet>(*input.images);
  for (session::PhotographRow& row : set->photographs) {
    std::vector<uint8_t> rgb;
    for (const uint8_t grey : row.pixels)
      for (const double tint : {1.15, 1.0, 0.85})
        rgb.push_back(static_cast<uint8_t>(std::min(255.0, tint * grey)));
    row.channels = 3;
    row.pixels = rgb;
  }
  input.images = set;
  EXPECT_TRUE(Found(input).empty());
  ImageSetFix some;
  some.swap_channels = true;
  some.images = {{12, 17}};
  const std::vector<PhotoMistake> found = Found(Corrupted(input, some));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].problem.kind, ProblemKind::kChannelOrder);
  EXPECT_EQ(session::FixOptions(found[0].fix), "--images 12-17 --swap-channels");
}

}  // namespace
}  // namespace touchstone::diagnosis::checks
