// A journal's photographs with their views: kept, checked, migrated, and given back as an image set.
#include "server/session/session_images.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include "server/base/test_folder.h"
#include "server/base/units.h"
#include "server/geometry/pose.h"
#include "server/image/encoding/encode.h"
#include "server/session/images/emulated.h"
#include "server/session/images/image_set_file.h"

namespace touchstone::session {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using Mode = Journal::Mode;

// On a fixture that stands aside and turned; the camera looks down from 250 mm, and the arm was 0.2 mm aside.
JournalImage ImageWithView(const std::string& id, double session_time_s) {
  Eigen::Isometry3d base_from_object = Eigen::Isometry3d::Identity();
  base_from_object.translation() = Eigen::Vector3d(0.3, -0.1, 0.05);
  base_from_object.linear() = geometry::RotationFromVector({0, 0, kPi / 2});
  Eigen::Isometry3d object_from_camera = Eigen::Isometry3d::Identity();
  object_from_camera.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal().toDenseMatrix();
  object_from_camera.translation() = Eigen::Vector3d(0, 0, 0.25);
  JournalImage image;
  image.id = id, image.object = "cup", image.up_face = "+z";
  image.base_from_camera = geometry::PoseVectorOf(base_from_object * object_from_camera);
  object_from_camera.translation() += Eigen::Vector3d(0.0002, 0, 0);
  image.measured_base_from_camera = geometry::PoseVectorOf(base_from_object * object_from_camera);
  image.unix_s = image.measured_unix_s = 1.7e9 + session_time_s;
  image.width = 4, image.height = 3;
  std::vector<uint8_t> rgb(4 * 3 * 3);
  for (size_t k = 0; k < rgb.size(); ++k) rgb[k] = static_cast<uint8_t>(7 * k + session_time_s);
  image.png = *image::EncodePng(rgb.data(), 4, 3, 3);
  JournalView& view = image.view.emplace();
  view.eye_m = {0, 0, 0.25}, view.at_m = {0, 0, 0.05}, view.up = {0, 2, 0};
  view.base_from_object = geometry::PoseVectorOf(base_from_object);
  view.session_time_s = session_time_s;
  view.fx_px = 6.5, view.fy_px = 6.4, view.cx_px = 1.5, view.cy_px = 1.25;
  view.distortion = {-0.2, 1.0 / 3, 0.001, 0, 0};
  return image;
}

class SessionImages : public ::testing::Test {
 protected:
  SessionImages() {
    Open();
    JournalSession session;
    session.name = "s";
    session.provenance = "UR3e at 192.168.0.10";
    EXPECT_TRUE(journal_->EnsureSession(session).ok());
  }

  void Open(Mode mode = Mode::kCreateOrReadWrite) {
    journal_.reset();
    auto journal = Journal::Open(Path(), mode);
    ASSERT_TRUE(journal.ok()) << journal.status();
    journal_ = *std::move(journal);
  }
  std::string Path() const { return folder_.Path("session.db"); }
  void Add(const JournalImage& image) {
    const absl::Status added = journal_->AddImage("s", image);
    ASSERT_TRUE(added.ok()) << added;
  }
  void Sql(const std::string& sql) {
    journal_.reset();
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(Path().c_str(), &database), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK)
        << sqlite3_errmsg(database);
    sqlite3_close(database);
  }
  std::string ErrorOf() const {
    const auto files = SessionImageSetFiles(*journal_, "s");
    return files.ok() ? "" : std::string(files.status().message());
  }
  std::vector<JournalImage> Images(const Journal& journal) const {
    std::vector<JournalImage> images;
    EXPECT_TRUE(journal
                    .ForEachImage("s",
                                  [&](const JournalImage& image) {
                                    images.push_back(image);
                                    return true;
                                  })
                    .ok());
    return images;
  }

  const TestFolder folder_;
  std::unique_ptr<Journal> journal_;
};

void ExpectSameView(const std::optional<JournalView>& a, const std::optional<JournalView>& b) {
  ASSERT_TRUE(a.has_value() && b.has_value());
  EXPECT_EQ(a->eye_m, b->eye_m);
  EXPECT_EQ(a->at_m, b->at_m);
  EXPECT_EQ(a->up, b->up);
  EXPECT_EQ(a->base_from_object, b->base_from_object);
  EXPECT_EQ(a->session_time_s, b->session_time_s);
  EXPECT_EQ(a->fx_px, b->fx_px);
  EXPECT_EQ(a->fy_px, b->fy_px);
  EXPECT_EQ(a->cx_px, b->cx_px);
  EXPECT_EQ(a->cy_px, b->cy_px);
  EXPECT_EQ(a->distortion, b->distortion);
}

TEST_F(SessionImages, BecomeAnImageSetInTheObjectsFrame) {
  const JournalImage first = ImageWithView("a", 1.5);
  Add(first);
  Add(ImageWithView("a #2", 2.5));
  JournalImage other = ImageWithView("b", 3.5);
  other.object = "plate", other.measured_base_from_camera.fill(kNaN);
  Add(other);
  const auto files = SessionImageSetFiles(*journal_, "s");
  ASSERT_TRUE(files.ok()) << files.status();
  EXPECT_EQ(files->files(0).png(), first.png);
  const auto set = ParseImageSet(*files);
  ASSERT_TRUE(set.ok()) << set.status();
  ASSERT_EQ(set->size(), 3u);
  EXPECT_EQ(set->objects, (std::vector<std::string>{"cup", "plate"}));
  // As it was commanded, number for number.
  const PhotographRow& row = set->photographs[0];
  EXPECT_EQ(row.commanded.eye_m, Eigen::Vector3d(0, 0, 0.25));
  EXPECT_EQ(row.commanded.at_m, Eigen::Vector3d(0, 0, 0.05));
  EXPECT_EQ(row.commanded.up, Eigen::Vector3d(0, 2, 0));
  ASSERT_TRUE(row.measured.has_value());
  EXPECT_LT((row.measured->eye_m - Eigen::Vector3d(0.0002, 0, 0.25)).norm(), 1e-12);
  EXPECT_LT((row.measured->at_m - Eigen::Vector3d(0.0002, 0, 0.05)).norm(), 1e-12);
  EXPECT_LT((row.measured->up - Eigen::Vector3d(0, 1, 0)).norm(), 1e-12);
  EXPECT_FALSE(set->photographs[2].measured.has_value());
  EXPECT_EQ(row.session_time_s, 1.5);
  EXPECT_EQ(row.channels, 3);
  EXPECT_EQ(row.round, 0);
  EXPECT_EQ(set->photographs[1].round, 1);
  EXPECT_EQ(set->photographs[2].round, 0);
  // Pixel centres at half-integers.
  EXPECT_EQ(set->camera.cx_px, 2);
  EXPECT_EQ(set->camera.cy_px, 1.75);
  EXPECT_EQ(set->camera.k1, -0.2);
  EXPECT_EQ(set->camera.k2, 1.0 / 3);
  EXPECT_EQ(set->camera.p1, 0.001);
  EXPECT_EQ(CountEmulated(*set), 0);
}

TEST_F(SessionImages, OfAnEmulatedRigSaySo) {
  JournalSession session;
  session.name = "emulated";
  session.emulated = true;
  ASSERT_TRUE(journal_->EnsureSession(session).ok());
  ASSERT_TRUE(journal_->AddImage("emulated", ImageWithView("a", 0)).ok());
  const auto files = SessionImageSetFiles(*journal_, "emulated");
  ASSERT_TRUE(files.ok()) << files.status();
  EXPECT_EQ(static_cast<size_t>(CountEmulated(*ParseImageSet(*files))), ParseImageSet(*files)->size());
}

TEST_F(SessionImages, WhatIsNoImageSetIsRefusedWithItsPicture) {
  EXPECT_THAT(ErrorOf(), HasSubstr("session 's' has no photograph"));
  Add(ImageWithView("a", 0));
  JournalImage other = ImageWithView("b", 1);
  other.view->fx_px = 7;
  Add(other);
  EXPECT_THAT(ErrorOf(), AllOf(HasSubstr("picture 1 ('b') of session 's'"), HasSubstr("another lens or size"),
                               HasSubstr("fx_px: 7,"), HasSubstr("fx_px: 6.5,")));
}

TEST_F(SessionImages, ALensOfMoreCoefficientsIsRefusedAndNotCut) {
  JournalImage image = ImageWithView("a", 0);
  image.view->distortion = {-0.2, 0.1, 0, 0, 0, 0.3, 0, 0};
  Add(image);
  EXPECT_THAT(ErrorOf(), AllOf(HasSubstr("'a'"), HasSubstr("8 coefficients"), HasSubstr("rig photos")));
}

TEST_F(SessionImages, ViewsAreCopiedAndTheirDamageIsNoticed) {
  Add(ImageWithView("a", 1));
  Add(ImageWithView("b", 2));
  {
    auto copy = Journal::Open(folder_.Path("copy.db"), Mode::kCreateOrReadWrite);
    ASSERT_TRUE(copy.ok());
    ASSERT_TRUE(journal_->CopySession("s", copy->get()).ok());
    const auto images = Images(**copy);
    ASSERT_EQ(images.size(), 2u);
    ExpectSameView(images[1].view, ImageWithView("b", 2).view);
  }
  Sql("CREATE TABLE before AS SELECT * FROM image_view");
  for (const char* damage : {"UPDATE image_view SET eye_z_m = 0.26 WHERE image_id = 2",
                             "UPDATE image_view SET distortion = '-0.2' WHERE image_id = 2",
                             "DELETE FROM image_view WHERE image_id = 2"}) {
    Sql("DELETE FROM image_view; INSERT INTO image_view SELECT * FROM before");
    Open(Mode::kReadOnly);
    EXPECT_EQ(ErrorOf(), "");
    Sql(damage);
    Open(Mode::kReadOnly);
    const auto files = SessionImageSetFiles(*journal_, "s");
    EXPECT_TRUE(absl::IsDataLoss(files.status())) << damage << ": " << files.status();
    EXPECT_THAT(std::string(files.status().message()),
                HasSubstr("picture 1 ('b') of session 's' is damaged"));
  }
  // The other one is left.
  int told = 0;
  auto rest = Journal::Open(Path(), Mode::kReadOnly, [&](const absl::Status&) { ++told; });
  ASSERT_TRUE(rest.ok());
  EXPECT_EQ(ParseImageSet(*SessionImageSetFiles(**rest, "s"))->size(), 1u);
  EXPECT_GT(told, 0);
}

TEST_F(SessionImages, GoToTheTrashComeBackAndEndWithTheirSession) {
  Add(ImageWithView("a", 1));
  ASSERT_TRUE(journal_->DeleteSession("s", "ana@lab").ok());
  EXPECT_FALSE(SessionImageSetFiles(*journal_, "s").ok());
  ASSERT_TRUE(journal_->RestoreSession("s").ok());
  EXPECT_EQ(ErrorOf(), "");
  ASSERT_TRUE(journal_->DeleteSession("s", "ana@lab").ok());
  ASSERT_TRUE(journal_->PurgeSession("s").ok());
  journal_.reset();
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(Path().c_str(), &database), SQLITE_OK);
  int rows = -1;
  const auto count = [](void* out, int, char** values, char**) {
    *static_cast<int*>(out) = std::atoi(values[0]);
    return 0;
  };
  sqlite3_exec(database, "SELECT count(*) FROM image_view", count, &rows, nullptr);
  sqlite3_close(database);
  EXPECT_EQ(rows, 0);
}

// What a program of before wrote: no table of views.
constexpr char kBackToVersion2[] = "DROP TABLE image_view; PRAGMA user_version = 2";

TEST_F(SessionImages, AJournalOfVersion2IsReadAsItIsAndGoesOn) {
  JournalImage old = ImageWithView("old", 1);
  old.view.reset();
  Add(old);
  Sql(kBackToVersion2);
  Open(Mode::kReadOnly);
  ASSERT_EQ(Images(*journal_).size(), 1u);
  EXPECT_FALSE(Images(*journal_)[0].view.has_value());
  EXPECT_THAT(ErrorOf(), AllOf(HasSubstr("picture 0 ('old')"), HasSubstr("before a picture's view")));
  for (int again = 0; again < 2; ++again) {
    Open(Mode::kReadWrite);
    ASSERT_EQ(Images(*journal_).size(), 1u);
    EXPECT_EQ(Images(*journal_)[0].png, old.png);
  }
  Add(ImageWithView("new", 2));
  ASSERT_EQ(Images(*journal_).size(), 2u);
  ExpectSameView(Images(*journal_)[1].view, ImageWithView("new", 2).view);
}

TEST_F(SessionImages, AJournalThatOnlyCallsItselfVersion2IsRefused) {
  Add(ImageWithView("a", 1));
  Sql("PRAGMA user_version = 2");
  for (const Mode mode : {Mode::kReadOnly, Mode::kReadWrite}) {
    const auto opened = Journal::Open(Path(), mode);
    EXPECT_TRUE(absl::IsDataLoss(opened.status())) << opened.status();
  }
}

}  // namespace
}  // namespace touchstone::session
