#include "server/session/images/image_set_hdf5.h"

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <filesystem>

#include "server/base/test_folder.h"
#include "server/base/text/text.h"
#include "server/session/images/image_set.h"
#include "server/session/images/image_set_file.h"

namespace touchstone::session {
namespace {

using testing::HasSubstr;

constexpr int kSetWidth = 7, kSetHeight = 5;

// Everything that a row may have and may lack.
ImageSet FullSet(bool with_rgb) {
  ImageSet set;
  set.origin = "full";
  set.camera = {kSetWidth, kSetHeight, 6.123456789012345, 6.2, 3.4, 2.6, -0.21, 0.05, 0.001, -0.002, 1.0 / 3};
  set.objects = {"lat20", "cup, \"big\""};
  set.has_session_time = set.has_round = set.has_measured = true;
  for (int k = 0; k < 4; ++k) {
    PhotographRow row;
    row.image = 10 + 7 * k;
    row.file = absl::StrCat("pictures/", k, ".png");
    row.object = k % 2;
    row.commanded = {{0.033333, 0.2, 0.25 + k}, {0.001, 0, 1e-7}, {0.1, 2.5, 0}};
    if (k != 1) row.measured = CameraPlacement{{1.0 / 3, 0.2, 0.25 + k}, {0, 0, 0}, {0, 1, 0}};
    row.session_time_s = 1.5 * k;
    row.round = k == 2 ? -1 : k;
    if (k > 1) row.touch = 100 + k;
    if (k != 3) row.covariates["cov_room_c"] = 20.1 + k;
    row.channels = with_rgb && k == 0 ? 3 : 1;
    row.pixels.resize(kSetWidth * kSetHeight * row.channels);
    for (size_t i = 0; i < row.pixels.size(); ++i) row.pixels[i] = static_cast<uint8_t>(i * 5 + k);
    set.photographs.push_back(row);
  }
  return set;
}

class ImageSetHdf5 : public testing::Test {
 protected:
  // The set that comes back.
  ImageSetWithTouches Again(const ImageSetWithTouches& set, const std::string& name) {
    const absl::Status written = WriteImageSetHdf5(set, Path(name));
    EXPECT_TRUE(written.ok()) << written;
    EXPECT_TRUE(IsImageSetHdf5(Path(name)));
    auto read = ReadImageSetHdf5(Path(name));
    EXPECT_TRUE(read.ok()) << read.status();
    return read.ok() ? *std::move(read) : ImageSetWithTouches();
  }
  std::string Path(const std::string& name) const { return folder_.Path(name); }
  // A dataset's first number in the file is another.
  void Overwrite(const std::string& dataset, uint64_t value) {
    const hid_t file = H5Fopen(Path("a.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t set = H5Dopen2(file, dataset.c_str(), H5P_DEFAULT), space = H5Dget_space(set);
    std::vector<uint64_t> values(H5Sget_simple_extent_npoints(space));
    EXPECT_GE(H5Dread(set, H5T_NATIVE_UINT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), 0);
    values[0] = value;
    EXPECT_GE(H5Dwrite(set, H5T_NATIVE_UINT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), 0);
    H5Sclose(space), H5Dclose(set);
    // As programs wrote it before there were checksums.
    EXPECT_GE(H5Adelete(file, "checksums"), 0);
    H5Fclose(file);
  }

  const TestFolder folder_;
};

TEST_F(ImageSetHdf5, ComesBackByteForByte) {
  for (const bool with_rgb : {false, true}) {
    ImageSetWithTouches set;
    set.images = *FormatImageSet(FullSet(with_rgb));
    set.touches_csv = "touch,object\n1,lat20\n";
    ImageSetWithTouches again = Again(set, "a.h5");
    EXPECT_EQ(again.touches_csv, set.touches_csv);
    EXPECT_EQ(again.images.origin(), Path("a.h5"));
    again.images.set_origin(set.images.origin());
    EXPECT_EQ(again.images.images_csv(), set.images.images_csv());
    EXPECT_EQ(again.images.camera_yaml(), set.images.camera_yaml());
    EXPECT_EQ(again.images.SerializeAsString(), set.images.SerializeAsString());
    std::filesystem::remove(Path("a.h5"));
  }
}

TEST_F(ImageSetHdf5, WhatASetDoesNotHaveDoesNotAppear) {
  ImageSet plain = FullSet(false);
  plain.has_session_time = plain.has_round = plain.has_measured = false;
  for (PhotographRow& row : plain.photographs) {
    row.measured.reset(), row.touch.reset(), row.covariates.clear();
    row.session_time_s = 0, row.round = -1;
  }
  ImageSetWithTouches set;
  set.images = *FormatImageSet(plain);
  EXPECT_EQ(Again(set, "a.h5").images.images_csv(), set.images.images_csv());
  EXPECT_EQ(Again(set, "c.h5").touches_csv, "");
}

TEST_F(ImageSetHdf5, PicturesAreADatasetThatOtherProgramsRead) {
  ImageSetWithTouches set;
  set.images = *FormatImageSet(FullSet(false));
  Again(set, "a.h5");
  const hid_t file = H5Fopen(Path("a.h5").c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  const hid_t dataset = H5Dopen2(file, "image", H5P_DEFAULT), space = H5Dget_space(dataset);
  hsize_t shape[3] = {};
  ASSERT_EQ(H5Sget_simple_extent_ndims(space), 3);
  H5Sget_simple_extent_dims(space, shape, nullptr);
  EXPECT_THAT(shape, testing::ElementsAre(4, kSetHeight, kSetWidth));
  std::vector<uint8_t> pixels(4 * kSetHeight * kSetWidth);
  EXPECT_GE(H5Dread(dataset, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, pixels.data()), 0);
  EXPECT_EQ(pixels[kSetHeight * kSetWidth + 3], 3 * 5 + 1);
  H5Sclose(space), H5Dclose(dataset), H5Fclose(file);
}

// Whether HDF5 keeps any time of an object; visits each of a file.
herr_t KeepsNoTime(hid_t, const char* name, const H5O_info_t* object, void* objects) {
  ++*static_cast<int*>(objects);
  EXPECT_EQ(object->atime, 0) << name;
  EXPECT_EQ(object->mtime, 0) << name;
  EXPECT_EQ(object->ctime, 0) << name;
  EXPECT_EQ(object->btime, 0) << name;
  return 0;
}

TEST_F(ImageSetHdf5, ALaterFileOfTheSameSetIsTheSameBytes) {
  ImageSetWithTouches set;
  set.images = *FormatImageSet(FullSet(false));
  Again(set, "a.h5");
  Again(set, "b.h5");
  EXPECT_TRUE(*ReadFile(Path("a.h5"), 1 << 24) == *ReadFile(Path("b.h5"), 1 << 24));
  const hid_t file = H5Fopen(Path("a.h5").c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  int objects = 0;
  EXPECT_GE(H5Ovisit2(file, H5_INDEX_NAME, H5_ITER_NATIVE, KeepsNoTime, &objects, H5O_INFO_TIME), 0);
  EXPECT_GT(objects, 10);
  H5Fclose(file);
}

TEST_F(ImageSetHdf5, WrongFilesAreErrorsThatNameTheDataset) {
  ImageSetWithTouches set;
  set.images = *FormatImageSet(FullSet(false));
  const struct {
    const char* dataset;
    uint64_t value;
    const char* words;
  } damages[] = {{"set/size", uint64_t{1} << 62, "set/size"}, {"set/size", 3, "dataset image has"},
                 {"channels", 2, "dataset channels"},         {"round", uint64_t{1} << 40, "dataset round"},
                 {"image_number", 17, "17 stands in line"},   {"set/covariates", 9999999, "set/covariates"}};
  for (const auto& damage : damages) {
    Again(set, "a.h5");
    Overwrite(damage.dataset, damage.value);
    const auto read = ReadImageSetHdf5(Path("a.h5"));
    EXPECT_TRUE(absl::IsInvalidArgument(read.status())) << damage.dataset << ": " << read.status();
    EXPECT_THAT(std::string(read.status().message()), HasSubstr(damage.words));
    std::filesystem::remove(Path("a.h5"));
  }
  EXPECT_FALSE(IsImageSetHdf5(Path("none.h5")));
  EXPECT_TRUE(absl::IsInvalidArgument(ReadImageSetHdf5(Path("none.h5")).status()));
  EXPECT_FALSE(WriteImageSetHdf5(set, Path("no/a.h5")).ok());
}

}  // namespace
}  // namespace touchstone::session
