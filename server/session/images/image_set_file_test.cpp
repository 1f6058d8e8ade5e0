#include "server/session/images/image_set_file.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <random>

#include "server/base/test_folder.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/image/encoding/encode.h"
#include "server/session/images/camera_yaml.h"
#include "server/session/images/images_csv.h"

namespace touchstone::session {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr int kWidth = 7, kHeight = 5;
constexpr char kHeader[] =
    "image,file,object,eye_x_mm,eye_y_mm,eye_z_mm,at_x_mm,at_y_mm,at_z_mm,up_x,up_y,up_z";
constexpr char kCamera[] = "{width_px: 7, height_px: 5, fx_px: 6.5, fy_px: 6.5, cx_px: 3.5, cy_px: 2.5}\n";

std::string Png(int width, int height, int channels, uint8_t first) {
  std::vector<uint8_t> pixels(static_cast<size_t>(width) * height * channels);
  for (size_t k = 0; k < pixels.size(); ++k) pixels[k] = static_cast<uint8_t>(first + 3 * k);
  return *image::EncodePng(pixels.data(), width, height, channels);
}

// A set of these rows and of a picture for each file name.
v1::ImageSetFiles Files(const std::string& rows, const std::vector<std::string>& names = {"a.png", "b.png"},
                        const std::string& header = kHeader) {
  v1::ImageSetFiles files;
  files.set_origin("set");
  files.set_images_csv(absl::StrCat(header, "\n", rows));
  files.set_camera_yaml(kCamera);
  for (const std::string& name : names) {
    v1::ImageFile* file = files.add_files();
    file->set_name(name);
    file->set_png(Png(kWidth, kHeight, 1, static_cast<uint8_t>(files.files_size())));
  }
  return files;
}
constexpr char kRows[] = "3,a.png,lat20,0,0,250,0,0,0,0,1,0\n9,b.png,lat00,250,0,0,0,0,0,0,0,2\n";

std::string ErrorOf(const v1::ImageSetFiles& files) {
  const auto set = ParseImageSet(files);
  EXPECT_FALSE(set.ok()) << files.images_csv();
  return set.ok() ? "" : std::string(set.status().message());
}
std::string ErrorOfRows(const std::string& rows) {
  return ErrorOf(Files(rows));
}

ImageSet RichSet() {
  ImageSet set;
  set.origin = "rich";
  set.camera = {kWidth, kHeight, 6.123456789012345, 6.2, 3.4, 2.6, -0.21, 0.05, 0.001, 0, 0};
  set.objects = {"lat20", "cup, \"big\""};
  set.has_session_time = set.has_round = set.has_measured = true;
  for (int k = 0; k < 4; ++k) {
    PhotographRow row;
    row.image = 10 + 7 * k;
    row.file = absl::StrCat("pictures/", k, ".png");
    row.object = k % 2;
    row.commanded = {{ToSi(Unit::kMillimetre, 33.333), 0.2, 0.25 + k}, {0.001, 0, 1e-7}, {0.1, 2.5, 0}};
    if (k != 1)
      row.measured = CameraPlacement{{ToSi(Unit::kMillimetre, 33.343), 0.2, 0.25 + k}, {0, 0, 0}, {0, 1, 0}};
    row.session_time_s = 1.5 * k;
    row.round = k == 2 ? -1 : k;
    if (k > 1) row.touch = 100 + k;
    if (k != 3) row.covariates["cov_room_c"] = 20.1 + k;
    row.channels = k == 0 ? 3 : 1;
    row.pixels.resize(kWidth * kHeight * row.channels);
    for (size_t i = 0; i < row.pixels.size(); ++i) row.pixels[i] = static_cast<uint8_t>(i * 5 + k);
    set.photographs.push_back(row);
  }
  return set;
}

void ExpectSame(const CameraPlacement& a, const CameraPlacement& b) {
  EXPECT_EQ(a.eye_m, b.eye_m);
  EXPECT_EQ(a.at_m, b.at_m);
  EXPECT_EQ(a.up, b.up);
}

TEST(ImageSetFile, AFolderComesBackAsItWasWritten) {
  const TestFolder folder;
  const ImageSet written = RichSet();
  ASSERT_TRUE(WriteImageSet(written, folder.Path("set")).ok());
  EXPECT_TRUE(IsImageSetFolder(folder.Path("set")));
  EXPECT_FALSE(HasTouches(folder.Path("set")));
  const auto read = ReadImageSet(folder.Path("set"));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->origin, folder.Path("set"));
  EXPECT_EQ(read->objects, written.objects);
  EXPECT_EQ(FormatCameraYaml(read->camera), FormatCameraYaml(written.camera));
  EXPECT_EQ(read->camera.fx_px, written.camera.fx_px);
  EXPECT_EQ(read->camera.k1, -0.21);
  EXPECT_EQ(read->camera.p1, 0.001);
  EXPECT_TRUE(read->has_session_time && read->has_round && read->has_measured);
  ASSERT_EQ(read->size(), written.size());
  for (size_t k = 0; k < read->size(); ++k) {
    const PhotographRow &a = read->photographs[k], &b = written.photographs[k];
    EXPECT_EQ(a.image, b.image);
    EXPECT_EQ(a.file, b.file);
    EXPECT_EQ(a.object, b.object);
    ExpectSame(a.commanded, b.commanded);
    ASSERT_EQ(a.measured.has_value(), b.measured.has_value());
    if (a.measured) ExpectSame(*a.measured, *b.measured);
    EXPECT_EQ(a.session_time_s, b.session_time_s);
    EXPECT_EQ(a.round, b.round);
    EXPECT_EQ(a.touch, b.touch);
    EXPECT_EQ(a.covariates, b.covariates);
    EXPECT_EQ(a.line, static_cast<int>(k) + 2);
    EXPECT_EQ(a.channels, b.channels);
    EXPECT_EQ(a.pixels, b.pixels);
  }
  // From memory the same, and what is written again has the same bytes.
  const auto files = ReadImageSetFiles(folder.Path("set"));
  ASSERT_TRUE(files.ok()) << files.status();
  EXPECT_EQ(ParseImageSet(*files)->sha256, read->sha256);
  EXPECT_EQ(FormatImageSet(*read)->SerializeAsString(), files->SerializeAsString());
}

TEST(ImageSetFile, HashIsWhatSha256sumPrints) {
  const TestFolder folder;
  ASSERT_TRUE(WriteImageSet(RichSet(), folder.path()).ok());
  const std::string command =
      absl::StrCat("cd ", folder.path(),
                   " && sha256sum images.csv camera.yaml pictures/0.png pictures/1.png pictures/2.png ",
                   "pictures/3.png | sha256sum | cut -d' ' -f1 > hash");
  ASSERT_EQ(std::system(command.c_str()), 0);
  EXPECT_EQ(ReadImageSet(folder.path())->sha256 + "\n", *ReadFile(folder.Path("hash")));
}

TEST(ImageSetFile, GreyOfAnRgbPictureIsTheMeanOfTheThree) {
  ImageSet set = RichSet();
  set.photographs[0].pixels[0] = 10, set.photographs[0].pixels[1] = 20, set.photographs[0].pixels[2] = 31;
  EXPECT_NEAR(set.Grey(0)[0], 61.0 / 3, 1e-5);
  EXPECT_EQ(set.Grey(0).size(), static_cast<size_t>(kWidth * kHeight));
  EXPECT_EQ(set.Grey(1)[3], static_cast<float>(set.photographs[1].pixels[3]));
}

TEST(ImageSetFile, AnImageSetIsNotWrittenOver) {
  const TestFolder folder;
  ASSERT_TRUE(WriteImageSet(RichSet(), folder.path()).ok());
  EXPECT_EQ(WriteImageSet(RichSet(), folder.path()).code(), absl::StatusCode::kAlreadyExists);
}

TEST(ImageSetFile, ColumnsMayStandInAnyOrder) {
  const auto set = ParseImageSet(Files("0,1,0,250,0,0,0,0,0,0,b.png,lat20,5,12.5\n", {"b.png"},
                                       "up_x,up_y,up_z,eye_z_mm,eye_x_mm,eye_y_mm,at_x_mm,at_y_mm,at_z_mm,"
                                       "session_time_s,file,object,image,cov_a"));
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_EQ(set->photographs[0].commanded.eye_m, Eigen::Vector3d(0, 0, 0.25));
  EXPECT_EQ(set->photographs[0].image, 5u);
  EXPECT_EQ(set->photographs[0].covariates.at("cov_a"), 12.5);
  EXPECT_FALSE(set->has_measured);
}

TEST(ImageSetFile, UpIsTakenAsItWasCommanded) {
  const auto set = ParseImageSet(Files(kRows));
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_EQ(set->photographs[1].commanded.up, Eigen::Vector3d(0, 0, 2)) << "neither unit nor perpendicular";
}

TEST(ImageSetFile, WrongHeadersAreRefusedWithTheirColumn) {
  const auto error = [](const std::string& header) {
    return ErrorOf(Files(kRows, {"a.png", "b.png"}, header));
  };
  EXPECT_THAT(error(absl::StrReplaceAll(kHeader, {{"eye_x_mm", "eye_x"}})),
              AllOf(HasSubstr("set/images.csv:1: column 4 'eye_x' is no column"), HasSubstr("eye_x_mm")));
  EXPECT_THAT(error(absl::StrReplaceAll(kHeader, {{"at_x_mm", "eye_y_mm"}})),
              HasSubstr("column 7 'eye_y_mm' stands twice in the header, first as column 5"));
  EXPECT_THAT(error(absl::StrReplaceAll(kHeader, {{",up_z", ""}})), HasSubstr("column 'up_z' is missing"));
  EXPECT_THAT(error(absl::StrReplaceAll(kHeader, {{"image,", ""}})), HasSubstr("column 'image' is missing"));
  EXPECT_THAT(error(absl::StrCat(kHeader, ",measured_eye_x_mm")),
              HasSubstr("column 'measured_eye_y_mm' is missing; a measured pose has all nine"));
  EXPECT_THAT(error(absl::StrCat(kHeader, ",cov_ä")), HasSubstr("is no name of a covariate"));
  EXPECT_THAT(error(absl::StrCat(kHeader, ",")), HasSubstr("a comma too many"));
  EXPECT_THAT(error(""), HasSubstr("a header line was expected"));
}

TEST(ImageSetFile, WrongFieldsAreRefusedWithTheirLineAndColumn) {
  EXPECT_THAT(ErrorOfRows("1,a.png,lat20,0,0,oops,0,0,0,0,1,0\n"),
              HasSubstr("set/images.csv:2: column eye_z_mm: 'oops' is not a number"));
  EXPECT_THAT(ErrorOfRows("1,a.png,lat20,0,0,nan,0,0,0,0,1,0\n"), HasSubstr("'nan' is not a finite number"));
  EXPECT_THAT(ErrorOfRows("1,a.png,lat20,0,0,1e99,0,0,0,0,1,0\n"), HasSubstr("1e99 is out of range"));
  EXPECT_THAT(ErrorOfRows("1,a.png,lat20,0,0,250,0,0,0,0,1\n"),
              HasSubstr(":2: has 11 columns, the header has 12"));
  EXPECT_THAT(ErrorOfRows("-1,a.png,lat20,0,0,250,0,0,0,0,1,0\n"), HasSubstr("-1 is not a whole number"));
  EXPECT_THAT(ErrorOfRows("1,a.png,,0,0,250,0,0,0,0,1,0\n"), HasSubstr("column object: is empty"));
  EXPECT_THAT(ErrorOfRows("1,,lat20,0,0,250,0,0,0,0,1,0\n"), HasSubstr("column file: is empty"));
  EXPECT_THAT(ErrorOfRows("1,\"a.png,lat20,0,0,250,0,0,0,0,1,0\n"), HasSubstr("no closing one"));
  EXPECT_THAT(ErrorOfRows(""), HasSubstr(":2: the file has a header but no photograph"));
  EXPECT_THAT(ErrorOf(Files("1,a.png,lat20,0,0,250,0,0,0,0,1,0,-2\n", {"a.png"},
                            absl::StrCat(kHeader, ",session_time_s"))),
              HasSubstr("column session_time_s: -2 is out of range"));
}

TEST(ImageSetFile, RowsThatStandTwiceAreRefused) {
  EXPECT_THAT(ErrorOfRows("1,a.png,lat20,0,0,250,0,0,0,0,1,0\n1,b.png,lat20,0,0,250,0,0,0,0,1,0\n"),
              HasSubstr("images.csv:3: column image: 1 stands in line 2 already"));
  EXPECT_THAT(ErrorOfRows("1,a.png,lat20,0,0,250,0,0,0,0,1,0\n2,a.png,lat20,0,0,250,0,0,0,0,1,0\n"),
              HasSubstr("images.csv:3: column file: 'a.png' stands in line 2 already"));
}

TEST(ImageSetFile, PosesWithoutAViewAreRefused) {
  EXPECT_THAT(ErrorOfRows("1,a.png,lat20,0,0,250,0,0,250,0,1,0\n"),
              HasSubstr("(0, 0, 250) mm looks at itself"));
  EXPECT_THAT(ErrorOfRows("1,a.png,lat20,0,0,250,0,0,0,0,0,0\n"),
              HasSubstr("columns up_*: (0, 0, 0) has length 0"));
  EXPECT_THAT(ErrorOfRows("1,a.png,lat20,0,0,250,0,0,0,0,0,3\n"),
              HasSubstr("columns up_*: (0, 0, 3) is parallel to the view"));
  const std::string header = absl::StrCat(
      kHeader, ",measured_eye_x_mm,measured_eye_y_mm,measured_eye_z_mm,measured_at_x_mm,measured_at_y_mm,",
      "measured_at_z_mm,measured_up_x,measured_up_y,measured_up_z");
  EXPECT_THAT(ErrorOf(Files("1,a.png,o,0,0,250,0,0,0,0,1,0,0,0,250,0,0,250,0,1,0\n", {"a.png"}, header)),
              HasSubstr("measured_eye_* and measured_at_*"));
  EXPECT_THAT(ErrorOf(Files("1,a.png,o,0,0,250,0,0,0,0,1,0,0,0,250,0,0,250,0,1,\n", {"a.png"}, header)),
              HasSubstr("8 of 9 are filled"));
}

TEST(ImageSetFile, NoNameLeadsOutOfTheFolder) {
  for (const char* name : {"../a.png", "/etc/passwd", "x/../../a.png", "..", ".", "x//a.png", "./a.png",
                           "a.png/", "..\\a.png", "images.csv", "touches.csv"}) {
    EXPECT_THAT(ErrorOf(Files(absl::StrCat("1,", name, ",lat20,0,0,250,0,0,0,0,1,0\n"), {name})),
                HasSubstr("set/images.csv:2: column file: "))
        << name;
    v1::ImageSetFiles files = Files(kRows, {name});
    const TestFolder folder;
    EXPECT_EQ(WriteImageSetFiles(files, folder.Path("out")).code(), absl::StatusCode::kInvalidArgument)
        << name;
    EXPECT_FALSE(std::filesystem::exists(folder.Path("a.png")));
  }
}

TEST(ImageSetFile, PicturesAndRowsBelongTogether) {
  EXPECT_THAT(ErrorOf(Files(kRows, {"a.png"})), HasSubstr("images.csv:3: column file: 'b.png' is not among"));
  EXPECT_THAT(ErrorOf(Files(kRows, {"a.png", "b.png", "c.png"})),
              HasSubstr("picture 'c.png' stands in no row"));
  EXPECT_THAT(ErrorOf(Files(kRows, {"a.png", "b.png", "b.png"})),
              HasSubstr("two pictures are named 'b.png'"));
  const TestFolder folder;
  ASSERT_TRUE(WriteImageSetFiles(Files(kRows), folder.path()).ok());
  ASSERT_TRUE(ReadImageSet(folder.path()).ok());
  std::filesystem::remove(folder.Path("b.png"));
  EXPECT_THAT(
      std::string(ReadImageSet(folder.path()).status().message()),
      AllOf(HasSubstr("images.csv:3: column file: 'b.png' cannot be read"), HasSubstr("No such file")));
  std::filesystem::create_directory(folder.Path("b.png"));
  EXPECT_THAT(std::string(ReadImageSet(folder.path()).status().message()), HasSubstr("is not a file"));
  std::filesystem::remove(folder.Path("camera.yaml"));
  EXPECT_THAT(std::string(ReadImageSet(folder.path()).status().message()),
              HasSubstr("camera.yaml: No such file"));
}

TEST(ImageSetFile, PicturesOfAnotherSizeOrKindAreRefused) {
  v1::ImageSetFiles files = Files(kRows);
  files.mutable_files(1)->set_png(Png(8, 5, 1, 0));
  EXPECT_THAT(ErrorOf(files),
              HasSubstr("images.csv:3: column file: 'b.png' is 8 x 5 pixels; 7 x 5, as camera.yaml"));
  files.mutable_files(1)->set_png("\xFF\xD8\xFF\xE0 a JPEG");
  EXPECT_THAT(ErrorOf(files), HasSubstr("'b.png' cannot be read: PNG"));
  files.mutable_files(1)->set_png("");
  EXPECT_THAT(ErrorOf(files), HasSubstr("'b.png' cannot be read: PNG"));
  files.mutable_files(1)->set_png(Png(kWidth, kHeight, 3, 9));
  EXPECT_TRUE(ParseImageSet(files).ok()) << "grey and RGB pictures may stand in one set";
}

TEST(ImageSetFile, WrongCamerasAreRefusedWithTheirPlace) {
  const auto error = [](const std::string& yaml) {
    v1::ImageSetFiles files = Files(kRows);
    files.set_camera_yaml(yaml);
    return ErrorOf(files);
  };
  const auto changed = [](const char* from, const char* to) {
    return absl::StrReplaceAll(kCamera, {{from, to}});
  };
  EXPECT_THAT(
      error(changed("fx_px: 6.5", "fx: 6.5")),
      AllOf(HasSubstr("set/camera.yaml:1:29: 'fx' is nothing that a camera.yaml holds"), HasSubstr("fx_px")));
  EXPECT_THAT(error(changed("fx_px: 6.5, ", "")), HasSubstr("fx_px is missing"));
  EXPECT_THAT(error(changed("fx_px: 6.5", "fx_px: -6.5")),
              HasSubstr("fx_px is -6.5; a focal length above 0"));
  EXPECT_THAT(error(changed("fx_px: 6.5", "fx_px: .nan")), HasSubstr("fx_px"));
  EXPECT_THAT(error(changed("fx_px: 6.5", "fx_px: nan")), HasSubstr("fx_px is nan"));
  EXPECT_THAT(error(changed("width_px: 7", "width_px: 7.5")), HasSubstr("a whole number of pixels"));
  EXPECT_THAT(error(changed("width_px: 7", "width_px: 4096")), HasSubstr("from 1 to 2048"));
  EXPECT_THAT(error(changed("width_px: 7", "width_px: [7]")), HasSubstr("a number was expected"));
  EXPECT_THAT(error(changed("cx_px: 3.5", "cx_px: 1e9")), HasSubstr("cx_px is 1e9"));
  EXPECT_THAT(error(changed("}", ", k1: 1e9}")), HasSubstr("k1 is 1e9"));
  EXPECT_THAT(error("- 1\n"), HasSubstr("set/camera.yaml:1:1: is "));
  EXPECT_FALSE(error("").empty());
  EXPECT_FALSE(error("{width_px: 7").empty());
}

// Whatever is cut off or garbled: an error or a set whose rows are whole, never a crash; a shortened picture is an error.
TEST(ImageSetFile, EveryTruncatedPictureIsRefused) {
  v1::ImageSetFiles files = Files(kRows);
  const std::string whole = files.files(1).png();
  for (size_t length = 0; length < whole.size(); ++length) {
    files.mutable_files(1)->set_png(whole.substr(0, length));
    EXPECT_FALSE(ParseImageSet(files).ok()) << "the first " << length << " of " << whole.size() << " bytes";
  }
}

TEST(ImageSetFile, EveryGarbledPictureIsRefusedOrHasTheSameSize) {
  v1::ImageSetFiles files = Files(kRows);
  const std::string whole = files.files(1).png();
  for (size_t at = 0; at < whole.size(); ++at)
    for (const int flip : {1, 0x20, 0x80, 0xFF}) {
      std::string garbled = whole;
      garbled[at] = static_cast<char>(garbled[at] ^ flip);
      files.mutable_files(1)->set_png(garbled);
      EXPECT_FALSE(ParseImageSet(files).ok()) << "byte " << at << " changed: every chunk has a checksum";
    }
}

TEST(ImageSetFile, GarbledTextNeverCrashesNorLosesARow) {
  const auto good = FormatImageSet(RichSet());
  ASSERT_TRUE(good.ok());
  std::mt19937 random(20310501);
  const std::string bytes = ",\"\n\r 0-.e;\x80\xFF/x{}[]:";
  int read = 0;
  for (int trial = 0; trial < 4000; ++trial) {
    v1::ImageSetFiles files = *good;
    std::string* text = trial % 4 == 0 ? files.mutable_camera_yaml() : files.mutable_images_csv();
    for (int edits = 1 + static_cast<int>(random() % 3); edits > 0 && !text->empty(); --edits) {
      const size_t at = random() % text->size();
      switch (random() % 4) {
        case 0:
          text->resize(at);
          break;
        case 1:
          text->erase(at, 1 + random() % 5);
          break;
        case 2:
          text->insert(at, 1, bytes[random() % bytes.size()]);
          break;
        default:
          (*text)[at] = bytes[random() % bytes.size()];
      }
    }
    const auto set = ParseImageSet(files);
    if (!set.ok()) {
      EXPECT_EQ(set.status().code(), absl::StatusCode::kInvalidArgument) << set.status();
      EXPECT_THAT(std::string(set.status().message()), testing::StartsWith("rich")) << "the file is named";
      continue;
    }
    ++read;
    EXPECT_EQ(set->size(), static_cast<size_t>(files.files_size())) << files.images_csv();
  }
  EXPECT_GT(read, 100) << "some changes are harmless";
}

TEST(ImageSetFile, SixteenBitAndTransparentPicturesAreNotConvertedInSilence) {
  // Made with Python's zlib: 7 x 5 pixels.
  const auto png = [](int depth, int colour, int bytes_per_pixel) {
    const TestFolder folder;
    const std::string script = absl::StrCat(
        "import zlib,struct\n"
        "def c(t,d): return struct.pack('>I',len(d))+t+d+struct.pack('>I',zlib.crc32(t+d))\n"
        "open('",
        folder.Path("p.png"), "','wb').write(b'\\x89PNG\\r\\n\\x1a\\n'+c(b'IHDR',struct.pack('>IIBBBBB',7,5,",
        depth, ",", colour, ",0,0,0))+c(b'IDAT',zlib.compress((b'\\0'+bytes(7*", bytes_per_pixel,
        "))*5))+c(b'IEND',b''))\n");
    std::ofstream(folder.Path("make.py")) << script;
    EXPECT_EQ(std::system(absl::StrCat("python3 ", folder.Path("make.py")).c_str()), 0);
    return *ReadFile(folder.Path("p.png"));
  };
  EXPECT_TRUE(image::DecodePlainPng(png(8, 0, 1)).ok());
  EXPECT_TRUE(image::DecodePlainPng(png(8, 2, 3)).ok());
  const auto error = [](const std::string& file) {
    return std::string(image::DecodePlainPng(file).status().message());
  };
  EXPECT_THAT(error(png(16, 0, 2)), HasSubstr("is 16-bit grey; 8-bit grey or RGB"));
  EXPECT_THAT(error(png(16, 2, 6)), HasSubstr("is 16-bit RGB"));
  EXPECT_THAT(error(png(8, 6, 4)), HasSubstr("RGB with transparency"));
  EXPECT_THAT(error(png(8, 4, 2)), HasSubstr("grey with transparency"));
}

}  // namespace
}  // namespace touchstone::session
