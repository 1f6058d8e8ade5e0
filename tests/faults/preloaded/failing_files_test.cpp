// Every step that writes a file, with the disk failing at each of its calls in turn, and killed before each: what it writes is
// whole or as it was before, and its status says which. A journal that stays open: failing_journal_test.cpp.
#include "client/source/dataset/synced_file.h"
#include "server/base/files/file_writer.h"
#include "server/base/files/new_file.h"
#include "server/base/test_tier.h"
#include "server/image/encoding/encode.h"
#include "server/session/images/image_set_file.h"
#include "server/session/images/image_set_hdf5.h"
#include "server/session/session_files.h"
#include "tests/faults/preloaded/failing_test.h"

namespace touchstone::faults {
namespace {

TEST_F(FailingFiles, ReplaceAFileOrLeaveIt) {
  ForEveryFailure([&] { std::ofstream(Out("a")) << "before"; },
                  [&] { return WriteFileAtomically(Out("a"), std::string(5000, 'x')); });
}

TEST_F(FailingFiles, MakeANewFileOrNone) {
  ForEveryFailure(Nothing, [&] {
    // Whoever is told of a failure after the name was taken finds it taken by these bytes.
    const absl::Status status = WriteNewFile(Out("a"), "new");
    return absl::IsAlreadyExists(status) && ReadFile(Out("a")).value() == "new" ? absl::OkStatus() : status;
  });
}

TEST_F(FailingFiles, MakeAHashedFileOrNone) {
  ForEveryFailure(Nothing, [&]() -> absl::Status {
    auto file = client::SyncedFile::Create(Out("a"));
    if (!file.ok()) return file.status();
    for (int k = 0; k < 3; ++k)
      if (absl::Status status = (*file)->Write(std::string(700'000, 'x')); !status.ok()) return status;
    return (*file)->Commit().status();
  });
}

// Pictures whose bytes do not compress: HDF5 and SQLite write them in many calls.
std::string NoisePng(int side, uint32_t seed) {
  std::string pixels;
  for (int k = 0; k < side * side; ++k)
    pixels += static_cast<char>((seed = seed * 1664525 + 1013904223) >> 24);
  return image::EncodePng(reinterpret_cast<const uint8_t*>(pixels.data()), side, side, 1).value();
}

constexpr char kCsv[] =
    "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,approach_"
    "z,"
    "lateral_x,lateral_y,lateral_z,t_l_us,t_m_us,t_r_us\n"
    "7,lat20,20.1,60,-12.3,0.1,7,0,0,-1,1,0,0,1250000.0625,,1250002.5\n"
    "3,cup,10,60,0,0,0,0,0,-1,1,0,0,3000000,3000100,3000200.125\n";

class FailingSessions : public FailingFiles {
 protected:
  FailingSessions() {
    std::ofstream(In("set.csv")) << kCsv;
    session::ImportOptions options;
    options.session = "s";
    content_ = session::ReadSessionCsv(In("set.csv"), options).value();
    session::JournalImage& image = content_.images.emplace_back();
    image.id = "front", image.object = "cup", image.width = image.height = 80;
    image.png = NoisePng(80, 1);
  }

  absl::Status WithJournal(const std::function<absl::Status(session::Journal*)>& step) {
    const auto journal = session::Journal::Open(Out("s.db"), session::Journal::Mode::kCreateOrReadWrite);
    return journal.ok() ? step(journal->get()) : journal.status();
  }
  absl::Status AddSession(const std::string& name) {
    session::SessionContent content = content_;
    content.session.name = name;
    return WithJournal([&](session::Journal* journal) { return journal->AddSession(content); });
  }
  void Prepare() { ASSERT_TRUE(AddSession("first").ok()); }

  session::SessionContent content_;
};

TEST_F(FailingSessions, AreAddedToANewJournalWholeOrNotAtAll) {
  ForEveryFailure(Nothing, [&] { return AddSession("s"); });
}

TEST_F(FailingSessions, AreAddedBesideOthersWholeOrNotAtAll) {
  TOUCHSTONE_SECOND_TIER("repeated: another step of a journal");
  ForEveryFailure([&] { Prepare(); }, [&] { return AddSession("s"); });
}

TEST_F(FailingSessions, GoToTheTrashOrStay) {
  TOUCHSTONE_SECOND_TIER("repeated: another step of a journal");
  ForEveryFailure(
      [&] { Prepare(); },
      [&] { return WithJournal([](auto* journal) { return journal->DeleteSession("first", "me"); }); });
}

TEST_F(FailingSessions, ComeBackFromTheTrashOrStayThere) {
  TOUCHSTONE_SECOND_TIER("repeated: another step of a journal");
  ForEveryFailure(
      [&] {
        Prepare();
        ASSERT_TRUE(WithJournal([](auto* journal) { return journal->DeleteSession("first", "me"); }).ok());
      },
      [&] { return WithJournal([](auto* journal) { return journal->RestoreSession("first"); }); });
}

TEST_F(FailingSessions, EndForGoodOrNot) {
  TOUCHSTONE_SECOND_TIER("repeated: another step of a journal");
  ForEveryFailure(
      [&] {
        Prepare();
        ASSERT_TRUE(WithJournal([](auto* journal) { return journal->DeleteSession("first", "me"); }).ok());
      },
      [&] { return WithJournal([](auto* journal) { return journal->PurgeSession("first"); }); });
}

TEST_F(FailingSessions, AreExportedWholeOrNotAtAll) {
  const std::string source = In("source.db");
  auto journal = session::Journal::Open(source, session::Journal::Mode::kCreateOrReadWrite).value();
  ASSERT_TRUE(journal->AddSession(content_).ok());
  ForEveryFailure(Nothing, [&] { return session::ExportSessionHdf5(*journal, "s", Out("s.h5")); });
}

TEST_F(FailingSessions, AreExportedAsCsvWholeOrNotAtAll) {
  auto journal = session::Journal::Open(In("source.db"), session::Journal::Mode::kCreateOrReadWrite).value();
  ASSERT_TRUE(journal->AddSession(content_).ok());
  ForEveryFailure(Nothing, [&] { return session::ExportSessionCsv(*journal, "s", Out("s.csv")); });
}

class FailingImageSets : public FailingFiles {
 protected:
  FailingImageSets() {
    std::string rows =
        "image,file,object,eye_x_mm,eye_y_mm,eye_z_mm,at_x_mm,at_y_mm,at_z_mm,up_x,up_y,up_z\n";
    for (int k = 0; k < 2; ++k) {
      v1::ImageFile* file = set_.images.add_files();
      file->set_name("p" + std::to_string(k) + ".png");
      file->set_png(NoisePng(40, static_cast<uint32_t>(k)));
      rows += std::to_string(k) + "," + file->name() + ",cup,300,0,0,0,0,0,0,0,1\n";
    }
    set_.images.set_origin("set");
    set_.images.set_images_csv(rows);
    set_.images.set_camera_yaml(
        "{width_px: 40, height_px: 40, fx_px: 40, fy_px: 40, cx_px: 20, cy_px: 20}\n");
    set_.touches_csv = kCsv;
  }
  session::ImageSetWithTouches set_;
};

TEST_F(FailingImageSets, AreOneFileOrNone) {
  ForEveryFailure(Nothing, [&] { return session::WriteImageSetHdf5(set_, Out("set.h5")); });
}

TEST_F(FailingImageSets, AreAWholeFolderOrNone) {
  ForEveryFailure(Nothing, [&] {
    return session::WriteImageSetFiles(set_.images, Out("set"), {{"touches.csv", set_.touches_csv}});
  });
}

}  // namespace
}  // namespace touchstone::faults
