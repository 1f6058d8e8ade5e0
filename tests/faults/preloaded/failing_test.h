// The fixture of tests in which every call of a step on the disk fails in turn, or the process is killed there. For tests.
#pragma once

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
#include <string>

#include "server/base/test_folder.h"
#include "server/base/text/text.h"
#include "server/session/journal/journal.h"
#include "tests/faults/preloaded/failing_files.h"

namespace touchstone::faults {

struct Fault {
  const char* name;
  FailureMode mode;
  int error;
};
inline constexpr Fault kFaults[] = {{"fails once", FailureMode::kOnce, EIO},
                                    {"full from then on", FailureMode::kFromThenOn, ENOSPC},
                                    {"interrupted", FailureMode::kOnce, EINTR},
                                    {"short", FailureMode::kShort, 0},
                                    {"killed", FailureMode::kKill, 0}};
inline constexpr int kMaxCalls = 5000;

// What stands in the folder, file by file; of a journal what its sessions export.
using Content = std::map<std::string, std::string>;

inline std::string SessionText(const session::Journal& journal, const std::string& name) {
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

inline void AddSessions(const std::string& path, Content* content) {
  std::error_code error;
  if (std::filesystem::file_size(path, error) == 0 || error) return;
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
inline Content ContentOf(const std::string& folder) {
  Content content;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const std::string name = std::filesystem::relative(entry.path(), folder).string();
    if (entry.path().extension() == ".db")
      AddSessions(entry.path().string(), &content);
    else if (entry.is_regular_file() && name.find(".db") == std::string::npos)
      content[name] = ReadFile(entry.path().string()).value();
  }
  return content;
}

inline bool IsLeftover(const std::string& name) {
  return name.find(".part") != std::string::npos;
}

class FailingFiles : public ::testing::Test {
 protected:
  FailingFiles() {
    void* shared =
        mmap(nullptr, sizeof(FailurePlan), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    plan_ = new (shared) FailurePlan{};
    std::strncpy(plan_->folder, std::filesystem::canonical(out()).c_str(), sizeof plan_->folder - 1);
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

  const std::string& out() const { return out_.path(); }

  void Clear() {
    for (const auto& entry : std::filesystem::directory_iterator(out()))
      std::filesystem::remove_all(entry.path());
  }

  void Set(const Fault& fault, int call) {
    plan_->mode = fault.mode, plan_->error = fault.error, plan_->calls = 0;
    plan_->fails_at = call;
  }

  // Of a process of its own, which may be killed.
  static absl::Status InChild(const std::function<absl::Status()>& step) {
    const pid_t child = fork();
    if (child == 0) _exit(step().ok() ? 0 : 1);
    int status = 0;
    waitpid(child, &status, 0);
    if (WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL) return absl::AbortedError("killed");
    return WIFEXITED(status) && WEXITSTATUS(status) == 0 ? absl::OkStatus()
                                                         : absl::UnknownError("ended otherwise");
  }

 private:
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

 protected:
  FailurePlan* plan_ = nullptr;
};

inline void Nothing() {}

}  // namespace touchstone::faults
