// Every step that writes, with the disk failing at each of its calls in turn, and killed before each: what it writes is whole
// or as it was before, and its status says which.
#include "tests/faults/failing_files.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <functional>
#include <map>
#include <new>

#include "client/source/synced_file.h"
#include "server/base/file_writer.h"
#include "server/base/new_file.h"
#include "server/base/test_folder.h"
#include "server/base/test_tier.h"
#include "server/base/text.h"
#include "server/image/encode.h"
#include "server/session/image_set_file.h"
#include "server/session/image_set_hdf5.h"
#include "server/session/session_files.h"

namespace touchstone::faults {
namespace {

namespace fs = std::filesystem;

struct Fault {
  const char* name;
  FailureMode mode;
  int error;
};
constexpr Fault kFaults[] = {{"fails once", FailureMode::kOnce, EIO},
                             {"full from then on", FailureMode::kFromThenOn, ENOSPC},
                             {"interrupted", FailureMode::kOnce, EINTR},
                             {"short", FailureMode::kShort, 0},
                             {"killed", FailureMode::kKill, 0}};
constexpr int kMaxCalls = 5000;

// What stands in the folder, file by file; of a journal what its sessions export.
using Content = std::map<std::string, std::string>;

std::string SessionText(const session::Journal& journal, const std::string& name) {
  std::string text;
  const absl::Status read = journal.ForEachTouch(name, [&](const session::JournalTouch& touch) {
    text += touch.id + " " + touch.object + " " + std::to_string(touch.result.fingers.size()) + "\n";
    return true;
  });
  if (!read.ok()) return std::string(read.message());
  const absl::Status images = journal.ForEachImage(name, [&](const session::JournalImage& image) {
    text += "picture " + image.id + Sha256Hex(image.png) + "\n";
    return true;
  });
  return images.ok() ? text : std::string(images.message());
}

void AddSessions(const std::string& path, Content* content) {
  std::error_code error;
  if (fs::file_size(path, error) == 0 || error) return;
  const auto journal = session::Journal::Open(path, session::Journal::Mode::kReadOnly);
  if (!journal.ok()) {
    // Killed before it had a table: it may become a journal.
    if (journal.status().message().find(" is empty") == std::string::npos)
      (*content)["journal"] = std::string(journal.status().message());
    return;
  }
  const auto sessions = (*journal)->Sessions(), deleted = (*journal)->DeletedSessions();
  ASSERT_TRUE(sessions.ok() && deleted.ok()) << sessions.status() << deleted.status();
  for (const auto& session : *sessions)
    (*content)["session " + session.name] = SessionText(**journal, session.name);
  for (const auto& session : *deleted) (*content)["deleted " + session.name] = "";
}

// Without what a killed program leaves beside the places of its files.
Content ContentOf(const std::string& folder) {
  Content content;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = fs::relative(entry.path(), folder).string();
    if (entry.path().extension() == ".db")
      AddSessions(entry.path().string(), &content);
    else if (entry.is_regular_file() && name.find(".db") == std::string::npos)
      content[name] = ReadFile(entry.path().string()).value();
  }
  return content;
}

bool IsLeftover(const std::string& name) {
  return name.find(".part") != std::string::npos;
}

class FailingFiles : public ::testing::Test {
 protected:
  FailingFiles() {
    void* shared =
        mmap(nullptr, sizeof(FailurePlan), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    plan_ = new (shared) FailurePlan{};
    std::strncpy(plan_->folder, fs::canonical(out()).c_str(), sizeof plan_->folder - 1);
    SetFailurePlan(plan_);
  }
  ~FailingFiles() override {
    SetFailurePlan(nullptr);
    munmap(plan_, sizeof(FailurePlan));
  }

  std::string Out(const std::string& name) const { return out() + "/" + name; }
  std::string In(const std::string& name) const { return inputs_.Path(name); }

  // `prepare` makes what is there before; `step` is what fails.
  void ForEveryFailure(const std::function<void()>& prepare, const std::function<absl::Status()>& step) {
    prepare();
    const Content before = ContentOf(out());
    Set(kFaults[0], 0);
    const absl::Status whole = step();
    ASSERT_TRUE(whole.ok()) << whole;
    const int calls = plan_->calls;
    const Content after = ContentOf(out());
    ASSERT_GT(calls, 0);
    ASSERT_LT(calls, kMaxCalls);
    ASSERT_NE(before, after);
    for (const Fault& fault : kFaults)
      for (int call = 1; call <= calls; ++call) {
        Clear();
        prepare();
        Set(fault, call);
        const bool killed = fault.mode == FailureMode::kKill;
        const absl::Status said = killed ? InChild(step) : step();
        plan_->fails_at = 0;
        SCOPED_TRACE(std::string(fault.name) + " at call " + std::to_string(call) + " of " +
                     std::to_string(calls) + ": " + plan_->failed + "; it says " + said.ToString());
        Check(ContentOf(out()), before, after, said, killed);
        EXPECT_TRUE(said.ok() || fault.mode != FailureMode::kShort);
        if (killed && !said.ok() && ContentOf(out()) != after) {
          const absl::Status again = step();
          EXPECT_TRUE(again.ok()) << "again: " << again;
        }
        if (HasFailure()) return;
      }
  }

 private:
  const std::string& out() const { return out_.path(); }

  void Clear() {
    for (const auto& entry : fs::directory_iterator(out())) fs::remove_all(entry.path());
  }

  void Set(const Fault& fault, int call) {
    plan_->mode = fault.mode, plan_->error = fault.error, plan_->calls = 0;
    plan_->fails_at = call;
  }

  static absl::Status InChild(const std::function<absl::Status()>& step) {
    const pid_t child = fork();
    if (child == 0) _exit(step().ok() ? 0 : 1);
    int status = 0;
    waitpid(child, &status, 0);
    if (WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL) return absl::AbortedError("killed");
    return WIFEXITED(status) && WEXITSTATUS(status) == 0 ? absl::OkStatus()
                                                         : absl::UnknownError("ended otherwise");
  }

  static void Check(const Content& found, const Content& before, const Content& after,
                    const absl::Status& said, bool killed) {
    if (said.ok()) {
      EXPECT_EQ(found, after);
      return;
    }
    for (const auto& [name, bytes] : found) {
      if (killed && IsLeftover(name)) continue;
      const bool old = before.count(name) == 1 && before.at(name) == bytes;
      const bool whole = after.count(name) == 1 && after.at(name) == bytes;
      EXPECT_TRUE(old || whole) << name << " is torn or left behind, with " << bytes.size() << " bytes";
    }
    for (const auto& [name, bytes] : before)
      EXPECT_TRUE(after.count(name) == 0 || found.count(name) == 1) << name << " is gone";
  }

  const TestFolder out_, inputs_;
  FailurePlan* plan_ = nullptr;
};

void Nothing() {}

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
