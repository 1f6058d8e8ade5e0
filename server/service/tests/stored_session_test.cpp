#include "server/service/sessions/stored_session.h"

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "server/base/test_folder.h"
#include "server/base/text/text.h"
#include "server/image/encoding/encode.h"
#include "server/service/calls/evidence.h"
#include "server/service/core/resources.h"
#include "server/service/sessions/session_store.h"
#include "server/session/images/image_set_file.h"

namespace touchstone::service {
namespace {

using ::testing::HasSubstr;

constexpr char kTouches[] =
    "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,"
    "approach_x,approach_y,approach_z,lateral_x,lateral_y,lateral_z,t_0_us\n"
    "7,cup,20,60,0,0,0,0,0,-1,1,0,0,100\n";

// Photographs of a mug and a cup, 4 x 3 pixels each.
v1::ImageSetFiles Photographs(int touch = 7) {
  v1::ImageSetFiles files;
  files.set_images_csv(absl::StrCat(
      "image,file,object,eye_x_mm,eye_y_mm,eye_z_mm,at_x_mm,at_y_mm,at_z_mm,up_x,up_y,",
      "up_z,touch\n1,a.png,mug,0,0,250,0,0,0,0,1,0,", touch, "\n2,views/b.png,cup,0,0,250,0,0,0,1,0,0,\n"));
  files.set_camera_yaml("{width_px: 4, height_px: 3, fx_px: 5, fy_px: 5, cx_px: 2, cy_px: 1.5}\n");
  for (const char* name : {"a.png", "views/b.png"}) {
    const std::vector<uint8_t> pixels(12, static_cast<uint8_t>(name[0]));
    v1::ImageFile* file = files.add_files();
    file->set_name(name);
    file->set_png(*image::EncodePng(pixels.data(), 4, 3, 1));
  }
  return files;
}

// As a client sends it, in pieces of `piece` bytes.
absl::Status Send(const v1::ImageSetFiles& files, const std::string& touches, size_t piece,
                  SessionStore::Upload* upload) {
  return ForEachPiece(PackSession({touches, files}), piece,
                      [&](const std::string& file, absl::string_view bytes) {
                        const absl::Status status = upload->Append(file, bytes);
                        EXPECT_TRUE(status.ok()) << status;
                        return status.ok();
                      });
}

class StoredSessionTest : public ::testing::TestWithParam<bool> {
 protected:
  StoredSessionTest() {
    ServerOptions options;
    if (GetParam()) options.sessions_dir = folder_.path();
    store_ = *SessionStore::Open(options);
  }
  absl::StatusOr<v1::Session> Create(const std::string& name, const v1::ImageSetFiles& files,
                                     const std::string& touches) {
    SessionStore::Upload upload(store_.get());
    EXPECT_TRUE(Send(files, touches, 17, &upload).ok());
    auto bytes = upload.Take();
    if (!bytes.ok()) return bytes.status();
    return store_->Create(name, *std::move(bytes));
  }
  const TestFolder folder_;
  std::unique_ptr<SessionStore> store_;
};
INSTANTIATE_TEST_SUITE_P(MemoryAndFolder, StoredSessionTest, ::testing::Bool());

TEST_P(StoredSessionTest, KeepsPhotographsAsTheyWereSent) {
  const auto created = Create("pictures", Photographs(), "");
  ASSERT_TRUE(created.ok()) << created.status();
  EXPECT_EQ(created->images(), 2u);
  EXPECT_EQ(created->touches(), 0u);
  EXPECT_THAT(created->objects(), testing::ElementsAre("mug", "cup"));
  EXPECT_TRUE(created->has_poses());
  EXPECT_EQ(created->hash(), session::ParseImageSet(Photographs())->sha256);
  EXPECT_EQ(store_->Find("pictures")->SerializeAsString(), created->SerializeAsString());
  EXPECT_EQ(store_->Names().size(), 1u);

  SessionPieces again;
  ASSERT_TRUE(store_
                  ->Export("pictures",
                           [&](const std::string& file, absl::string_view piece) {
                             EXPECT_TRUE(again.Append(file, piece).ok());
                             return true;
                           })
                  .ok());
  EXPECT_EQ(*again.Take(), **store_->Bytes("pictures"));
  EXPECT_EQ(UnpackSession(**store_->Bytes("pictures"))->images->SerializeAsString(),
            Photographs().SerializeAsString());
  EXPECT_TRUE(store_->Delete("pictures").ok());
  EXPECT_TRUE(absl::IsNotFound(store_->Find("pictures").status()));
  EXPECT_TRUE(!GetParam() || std::filesystem::is_empty(folder_.path()));
}

TEST_P(StoredSessionTest, TouchesAndPhotographsAreOneSession) {
  const auto created = Create("both", Photographs(), kTouches);
  ASSERT_TRUE(created.ok()) << created.status();
  EXPECT_EQ(created->images(), 2u);
  EXPECT_EQ(created->touches(), 1u);
  EXPECT_EQ(created->fingers(), 1u);
  EXPECT_THAT(created->objects(), testing::ElementsAre("cup", "mug"));
  EXPECT_NE(created->hash(), Create("alone", Photographs(), "")->hash());
  EXPECT_EQ(UnpackSession(**store_->Bytes("both"))->csv, kTouches);
  const auto stray = Create("stray", Photographs(8), kTouches);
  EXPECT_THAT(std::string(stray.status().message()),
              HasSubstr("stray/images.csv:2: column touch: 8 is no touch"));
}

TEST_P(StoredSessionTest, ANameStandsForOneKindOfSession) {
  ASSERT_TRUE(Create("monday", Photographs(), "").ok());
  EXPECT_TRUE(Create("monday", Photographs(), "").ok()) << "the same bytes again";
  EXPECT_TRUE(absl::IsAlreadyExists(Create("monday", Photographs(), kTouches).status()));
  EXPECT_TRUE(absl::IsAlreadyExists(store_->Create("monday", kTouches).status()));
  ASSERT_TRUE(store_->Create("tuesday", kTouches).ok());
  EXPECT_TRUE(absl::IsAlreadyExists(Create("tuesday", Photographs(), "").status()));
  EXPECT_EQ(store_->Names().size(), 2u);
}

TEST_P(StoredSessionTest, WhatIsWrongIsNotStored) {
  v1::ImageSetFiles files = Photographs();
  files.mutable_files(1)->set_png("no picture");
  EXPECT_THAT(std::string(Create("x", files, "").status().message()),
              HasSubstr("x/images.csv:3: column file: 'views/b.png' cannot be read"));
  EXPECT_THAT(std::string(Create("x", Photographs(), "object\ncup\n").status().message()),
              HasSubstr("x/touches.csv:1"));
  EXPECT_TRUE(absl::IsNotFound(store_->Find("x").status()));
}

// A server's evidence: photographs and touches of one session, whichever way they came.
class EvidenceOfImages : public ::testing::Test {
 protected:
  EvidenceOfImages() {
    resources_.options.max_memory_mib = 64;
    resources_.OpenPlaces();
    resources_.memory->Begin();
    resources_.sessions = *SessionStore::Open(resources_.options);
    resources_.models = *ModelStore::Open("");
    model::Model model;
    model.name = "nominal";
    EXPECT_TRUE(resources_.models->Create(model).ok());
    evidence_.mutable_model()->set_name("nominal");
    for (const char* name : {"cup", "mug"}) {
      v1::MeshFile* mesh = evidence_.add_meshes();
      mesh->set_name(name);
      mesh->set_format(v1::MeshFile::OFF);
      mesh->set_data("OFF\n4 4 0\n0 0 0\n50 0 0\n0 50 0\n0 0 50\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n");
    }
  }
  void Store(const std::string& name, const v1::ImageSetFiles& files, const std::string& touches) {
    ASSERT_TRUE(resources_.sessions->Create(name, PackSession({touches, files})).ok());
  }
  absl::StatusOr<diagnosis::DiagnosisInput> Read() const { return ReadEvidence(evidence_, resources_); }

  Resources resources_;
  v1::Evidence evidence_;
};

TEST_F(EvidenceOfImages, PhotographsAloneAreEnough) {
  *evidence_.mutable_images() = Photographs();
  const auto sent = Read();
  ASSERT_TRUE(sent.ok()) << sent.status();
  EXPECT_EQ(sent->set, nullptr);
  EXPECT_EQ(sent->images->size(), 2u);
  EXPECT_EQ(sent->surfaces.count("mug"), 1u);
  evidence_.clear_images();
  Store("pictures", Photographs(), "");
  evidence_.set_session("pictures");
  const auto stored = Read();
  ASSERT_TRUE(stored.ok()) << stored.status();
  EXPECT_EQ(stored->set, nullptr);
  EXPECT_EQ(stored->images->sha256, sent->images->sha256);
  EXPECT_EQ(stored->images->origin, "pictures");
}

TEST_F(EvidenceOfImages, TouchesAndPhotographsComeTogether) {
  Store("both", Photographs(), kTouches);
  evidence_.set_session("both");
  const auto stored = Read();
  ASSERT_TRUE(stored.ok()) << stored.status();
  EXPECT_EQ(stored->set->size(), 1);
  EXPECT_EQ(stored->images->size(), 2u);
  *evidence_.mutable_images() = Photographs();
  EXPECT_THAT(std::string(Read().status().message()), HasSubstr("which holds photographs already"));
  evidence_.set_csv(kTouches);
  EXPECT_TRUE(Read().ok()) << "a file of touches beside photographs";
}

TEST_F(EvidenceOfImages, PixelsCountAsLongAsTheyAreHeld) {
  *evidence_.mutable_images() = Photographs();
  {
    const auto pictures = Read();
    ASSERT_TRUE(pictures.ok()) << pictures.status();
    EXPECT_FALSE(resources_.memory->Reserve(resources_.memory->bytes()).ok());
  }
  const auto all = resources_.memory->Reserve(resources_.memory->bytes());
  EXPECT_TRUE(all.ok()) << all.status();
  EXPECT_TRUE(absl::IsResourceExhausted(Read().status()));
}

TEST_F(EvidenceOfImages, AnObjectWithoutAMeshIsNamedWithItsRow) {
  evidence_.mutable_meshes()->RemoveLast();
  *evidence_.mutable_images() = Photographs();
  EXPECT_THAT(std::string(Read().status().message()),
              HasSubstr("images/images.csv:2: column object: 'mug' has no mesh"));
}

TEST(SessionPieces, FilesFollowEachOther) {
  const auto error = [](const std::vector<std::string>& files) {
    SessionPieces pieces;
    absl::Status status;
    for (const std::string& file : files)
      if (status.ok()) status = pieces.Append(file, "x");
    if (status.ok()) status = pieces.Take().status();
    return std::string(status.message());
  };
  EXPECT_EQ(error({"images.csv", "images.csv", "a.png", "camera.yaml"}), "");
  EXPECT_THAT(error({"images.csv", "a.png", "images.csv"}), HasSubstr("'images.csv' comes a second time"));
  EXPECT_THAT(error({"touches.csv", "a.png", "touches.csv"}), HasSubstr("'touches.csv' comes a second time"));
  EXPECT_THAT(error({"", "images.csv"}), HasSubstr("file = 'images.csv' follows ''"));
  EXPECT_THAT(error({"images.csv", ""}), HasSubstr("file = '' follows 'images.csv'"));
  EXPECT_THAT(error({"a.png"}), HasSubstr("has no images.csv"));
  EXPECT_THAT(error({"../a.png"}), HasSubstr("is no plain path"));
}

TEST(StoredSession, DamageIsNoticed) {
  std::string bytes = PackSession({"", Photographs()});
  bytes.resize(bytes.size() - 3);
  EXPECT_EQ(UnpackSession(bytes).status().code(), absl::StatusCode::kDataLoss);
  EXPECT_FALSE(DescribeSession("x", bytes, "x").ok());
}

}  // namespace
}  // namespace touchstone::service
