// HDF5 files of sessions that were damaged, changed, or made by someone with intentions.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <sys/stat.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "server/base/files/file_writer.h"
#include "server/base/numbers/nan.h"
#include "server/base/test_folder.h"
#include "server/base/test_tier.h"
#include "server/base/text/text.h"
#include "server/image/encoding/encode.h"
#include "server/session/hdf5/hdf5_handle.h"
#include "server/session/recorded/touch_series.h"
#include "server/session/session_files.h"

namespace touchstone::session {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr char kTwoTouches[] =
    "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,approach_"
    "z,"
    "lateral_x,lateral_y,lateral_z,t_l_us,t_m_us,t_r_us,round\n"
    "7,lat20,20.1,60,-12.3,0.1,7,0,0,-1,1,0,0,1250000.0625,,1250002.5,0\n"
    "3,cup,10,60,0,0,0,0,0,-1,1,0,0,3000000,3000100,3000200.125,1\n";

ImportOptions ImportAs(const std::string& name) {
  ImportOptions options;
  options.session = name;
  return options;
}

SessionContent Content(const TestFolder& folder) {
  std::ofstream(folder.Path("set.csv")) << kTwoTouches;
  SessionContent content = ReadSessionCsv(folder.Path("set.csv"), ImportAs("s")).value();
  v1::TouchSeries states;
  for (int k = 0; k < 2; ++k) {
    states.add_time_s(k / 3.0);
    for (int i = 0; i < 6; ++i) states.add_joints_rad(k + i / 7.0), states.add_base_from_tip(k - i / 7.0);
    for (int i = 0; i < 3; ++i) states.add_tip_force_n(10 * k + i / 7.0);
  }
  content.series = {JournalSeries{kSeriesEncoding, states.SerializeAsString()}, std::nullopt};
  JournalImage& image = content.images.emplace_back();
  image.id = "front", image.object = "cup", image.width = 6, image.height = 5;
  image.png = image::EncodePng(std::vector<uint8_t>(30, 99).data(), 6, 5, 1).value();
  JournalView& view = image.view.emplace();
  view.eye_m = {0.3, 0, 0.1}, view.up = {0, 0, 1};
  view.fx_px = view.fy_px = 9, view.cx_px = 3, view.cy_px = 2, view.distortion = {-0.2, 1.0 / 9};
  return content;
}

// Equal text for what is equal to the last bit.
std::string TextOf(const SessionContent& content) {
  std::string text = content.session.name + content.session.provenance + content.session.calibration;
  const auto add = [&](const auto& value) {
    text.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  add(content.session.created_unix_s), add(content.session.spacing_m), add(content.session.fingers);
  for (const JournalTouch& touch : content.touches) {
    text += touch.id + touch.object + touch.up_face + touch.command;
    add(touch.attempt), add(touch.round.value_or(-1)), add(touch.face.value_or(-1));
    const JournalResult& result = touch.result;
    for (const double number :
         {result.speed_m_s, result.session_time_s, result.start_unix_s, result.time_uncertainty_s,
          result.synchronisation_uncertainty_s, result.effector_drift})
      add(number);
    add(result.recovered);
    for (const JournalFinger& finger : result.fingers)
      add(finger.contact_time_s), add(finger.base_from_tip), add(finger.ticks);
  }
  for (const auto& series : content.series) text += series ? series->columns : "none";
  for (const JournalImage& image : content.images) {
    text += image.id + image.object + image.up_face + image.png;
    add(image.base_from_camera), add(image.measured_base_from_camera), add(image.measured_unix_s);
    add(image.unix_s), add(image.width), add(image.height);
    const JournalView view = image.view.value_or(JournalView());
    add(image.view.has_value()), add(view.eye_m), add(view.at_m), add(view.up), add(view.base_from_object);
    for (const double number : {view.session_time_s, view.fx_px, view.fy_px, view.cx_px, view.cy_px})
      add(number);
    for (const double number : view.distortion) add(number);
  }
  return text;
}

class SessionHdf5 : public ::testing::Test {
 protected:
  SessionHdf5() {
    const auto journal = Journal::Open(folder_.Path("s.db"), Journal::Mode::kCreateOrReadWrite).value();
    EXPECT_TRUE(journal->AddSession(Content(folder_)).ok());
    EXPECT_TRUE(ExportSessionHdf5(*journal, "s", path_).ok());
    bytes_ = ReadFile(path_).value();
  }

  static Hdf5Handle Open(const std::string& path) {
    return Hdf5Handle(H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), H5Fclose);
  }
  // A file as programs wrote it before there were checksums.
  void WithoutChecksums() {
    const Hdf5Handle file = Open(path_);
    ASSERT_GE(H5Adelete(file, "checksums"), 0);
  }
  // Other values in place of those that are there.
  void Change(const char* name, const std::vector<double>& values) {
    const Hdf5Handle file = Open(path_);
    const Hdf5Handle dataset(H5Dopen2(file, name, H5P_DEFAULT), H5Dclose);
    const hsize_t count = values.size();
    const Hdf5Handle memory(H5Screate_simple(1, &count, nullptr), H5Sclose),
        all(H5Dget_space(dataset), H5Sclose);
    ASSERT_EQ(H5Sget_simple_extent_npoints(all), static_cast<hssize_t>(count));
    ASSERT_GE(H5Dwrite(dataset, H5T_NATIVE_DOUBLE, memory, all, H5P_DEFAULT, values.data()), 0);
  }
  // Another dataset or link of its name.
  void Replace(const char* name, const std::function<void(hid_t file)>& make) {
    const Hdf5Handle file = Open(path_);
    ASSERT_GE(H5Ldelete(file, name, H5P_DEFAULT), 0);
    make(file);
  }
  std::string Refusal() const {
    const auto read = ReadSessionHdf5(path_, {});
    return read.ok() ? "it was read" : std::string(read.status().message());
  }
  void Restore() const { ASSERT_TRUE(WriteFileAtomically(path_, bytes_).ok()); }

  const TestFolder folder_;
  const std::string path_ = folder_.Path("s.h5");
  std::string bytes_;
};

TEST_F(SessionHdf5, IsReadAsItWas) {
  const auto read = ReadSessionHdf5(path_, {});
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(TextOf(*read), TextOf(Content(folder_)));
  WithoutChecksums();
  const auto old = ReadSessionHdf5(path_, {});
  ASSERT_TRUE(old.ok()) << old.status();
  EXPECT_EQ(TextOf(*old), TextOf(*read));
}

// Each of these bits, flipped alone, is noticed, or changes nothing that is read.
void FlipBits(const std::string& path, const std::string& bytes, size_t step) {
  const std::string whole = TextOf(ReadSessionHdf5(path, {}).value());
  const int file = open(path.c_str(), O_WRONLY);
  for (size_t at = 0; at < bytes.size(); at += step) {
    const char flipped = static_cast<char>(bytes[at] ^ (1 << (at / step % 8)));
    ASSERT_EQ(pwrite(file, &flipped, 1, static_cast<off_t>(at)), 1);
    const auto read = ReadSessionHdf5(path, {});
    EXPECT_TRUE(!read.ok() || TextOf(*read) == whole) << "byte " << at << " of " << bytes.size();
    ASSERT_EQ(pwrite(file, &bytes[at], 1, static_cast<off_t>(at)), 1);
  }
  close(file);
}

TEST_F(SessionHdf5, NoFlippedBitGetsThrough) {
  FlipBits(path_, bytes_, 67);
}

TEST_F(SessionHdf5, NoFlippedBitOfAnyByteGetsThrough) {
  TOUCHSTONE_SECOND_TIER("repeated: every byte of a file");
  FlipBits(path_, bytes_, 1);
}

TEST_F(SessionHdf5, AValueThatWasChangedIsNamed) {
  Change("measured_speed_m_s", {0.01, 0.02});
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("s.h5: dataset measured_speed_m_s is damaged or was changed"),
                               HasSubstr("export the session again")));
}

TEST_F(SessionHdf5, NumbersOutOfRangeAreRefusedAsInACsvFile) {
  WithoutChecksums();
  bytes_ = ReadFile(path_).value();
  const auto refusal = [&](const char* name, const std::vector<double>& values) {
    Restore();
    Change(name, values);
    return Refusal();
  };
  EXPECT_THAT(refusal("contact_time_s", {-5, 1, 1, 1, 1, 1}),
              HasSubstr("touch 7: a contact time (-5) is out of range"));
  EXPECT_THAT(refusal("contact_time_s", {1, 1, 1, 1, 1e300, 1}),
              HasSubstr("touch 3: a contact time (1e+300)"));
  EXPECT_THAT(refusal("session_time_s", {-1, 0}), HasSubstr("session_time_s (-1) is out of range"));
  EXPECT_THAT(refusal("start_unix_s", {0, HUGE_VAL}), HasSubstr("start_unix_s (inf) is out of range"));
  EXPECT_THAT(refusal("measured_speed_m_s", {-1, 0}), HasSubstr("touch 0: measured_speed_m_s (-1)"));
  EXPECT_THAT(refusal("effector_drift", {7, 0}), HasSubstr("effector_drift (7)"));
  EXPECT_THAT(refusal("standoff_m", {0.06, 7}),
              HasSubstr("touch 1: dataset standoff_m has 7, its command 0.06"));
  EXPECT_THAT(refusal("attempt", {1, 0}), HasSubstr("touch 1: attempt (0)"));
  EXPECT_THAT(refusal("round", {1, 1e12}), HasSubstr("round (1000000000000) is out of range"));
  EXPECT_THAT(refusal("recovered", {2, 0}), HasSubstr("recovered (2)"));
  EXPECT_THAT(refusal("base_from_tip_position_m", std::vector<double>(18, -HUGE_VAL)),
              HasSubstr("base_from_tip (-inf)"));
  EXPECT_THAT(refusal("series/tip_force_n", {0, 0, 0, 0, 0, HUGE_VAL}),
              HasSubstr("series/tip_force_n (inf)"));
  EXPECT_THAT(refusal("images/width_height_px", {7, 5}), HasSubstr("its picture has 6 x 5 px, not 7 x 5"));
  EXPECT_THAT(refusal("images/eye_m", {HUGE_VAL, 0, 0}), HasSubstr("picture 0: its view (inf)"));
  EXPECT_THAT(refusal("session/spacing_m", {kNaN}), HasSubstr("spacing_m (nan)"));
  EXPECT_THAT(refusal("session/created_unix_s", {-3}), HasSubstr("created_unix_s (-3)"));
  EXPECT_THAT(refusal("session/fingers_touches_images", {3, 1e9, 1}), HasSubstr("rows cannot be read"));
}

TEST_F(SessionHdf5, NothingIsReadFromElsewhere) {
  WithoutChecksums();
  bytes_ = ReadFile(path_).value();
  const std::string secret = folder_.Path("secret");
  std::ofstream(secret) << std::string(100, 'x');
  ASSERT_TRUE(WriteFileAtomically(folder_.Path("other.h5"), bytes_).ok());
  const auto refusal = [&](const std::function<void(hid_t)>& make) {
    Restore();
    Replace("contact_time_s", make);
    return Refusal();
  };
  const hsize_t shape[] = {2, 3};
  const Hdf5Handle space(H5Screate_simple(2, shape, nullptr), H5Sclose);
  EXPECT_THAT(refusal([&](hid_t file) {
                H5Lcreate_external(folder_.Path("other.h5").c_str(), "contact_time_s", file, "contact_time_s",
                                   H5P_DEFAULT, H5P_DEFAULT);
              }),
              HasSubstr("dataset contact_time_s is a link to another place"));
  EXPECT_THAT(refusal([](hid_t file) {
                H5Lcreate_soft("/standoff_m", file, "contact_time_s", H5P_DEFAULT, H5P_DEFAULT);
              }),
              HasSubstr("is a link to another place"));
  EXPECT_THAT(refusal([&](hid_t file) {
                const Hdf5Handle external(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
                H5Pset_external(external, secret.c_str(), 0, 48);
                Hdf5Handle(H5Dcreate2(file, "contact_time_s", H5T_IEEE_F64LE, space, H5P_DEFAULT, external,
                                      H5P_DEFAULT),
                           H5Dclose);
              }),
              HasSubstr("has its values in another file"));
  EXPECT_THAT(refusal([&](hid_t file) {
                const Hdf5Handle from(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
                H5Pset_virtual(from, space, folder_.Path("other.h5").c_str(), "contact_time_s", space);
                Hdf5Handle(
                    H5Dcreate2(file, "contact_time_s", H5T_IEEE_F64LE, space, H5P_DEFAULT, from, H5P_DEFAULT),
                    H5Dclose);
              }),
              HasSubstr("has its values in another file"));
  Restore();
  Replace("series", [&](hid_t file) {
    H5Lcreate_external(folder_.Path("other.h5").c_str(), "series", file, "series", H5P_DEFAULT, H5P_DEFAULT);
  });
  EXPECT_THAT(Refusal(), HasSubstr("dataset series/states is a link"));
}

TEST_F(SessionHdf5, MemoryIsTakenForValuesThatAreThereAlone) {
  WithoutChecksums();
  Replace("images/png", [](hid_t file) {
    const hsize_t count = 2'000'000'000;
    const Hdf5Handle space(H5Screate_simple(1, &count, nullptr), H5Sclose);
    Hdf5Handle(H5Dcreate2(file, "images/png", H5T_STD_U8LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
               H5Dclose);
  });
  Change("images/png_offset", {0, 2'000'000'000});
  EXPECT_THAT(Refusal(), HasSubstr("dataset images/png has 0 bytes of 2000000000"));
}

TEST_F(SessionHdf5, FilesThatOthersCompressedAreRead) {
  const std::string whole = TextOf(ReadSessionHdf5(path_, {}).value());
  Replace("contact_time_s", [](hid_t file) {
    const hsize_t shape[] = {2, 3};
    const Hdf5Handle space(H5Screate_simple(2, shape, nullptr), H5Sclose);
    const Hdf5Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    H5Pset_chunk(creation, 2, shape);
    H5Pset_deflate(creation, 4);
    const Hdf5Handle dataset(
        H5Dcreate2(file, "contact_time_s", H5T_IEEE_F64LE, space, H5P_DEFAULT, creation, H5P_DEFAULT),
        H5Dclose);
    const double times_s[] = {1.2500000625, kNaN, 1.2500025, 3, 3.0001, 3.000200125};
    H5Dwrite(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, times_s);
  });
  EXPECT_THAT(Refusal(), HasSubstr("its datasets are not those that were written"));
  WithoutChecksums();
  const auto read = ReadSessionHdf5(path_, {});
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->touches[1].result.fingers[2].contact_time_s, 3.000200125);
}

TEST_F(SessionHdf5, WhatIsNoFileIsRefused) {
  ASSERT_EQ(mkfifo(folder_.Path("fifo.h5").c_str(), 0600), 0);
  EXPECT_FALSE(ReadSessionHdf5(folder_.Path("fifo.h5"), {}).ok());
  EXPECT_FALSE(ReadSessionHdf5(folder_.path(), {}).ok());
}

}  // namespace
}  // namespace touchstone::session
