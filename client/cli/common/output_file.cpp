#include "client/cli/common/output_file.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <fcntl.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <random>
#include <utility>

#include "client/cli/common/progress_bar.h"
#include "server/base/files/file_writer.h"
#include "server/base/status.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxLinks = 40;
constexpr size_t kBlockBytes = 1 << 20;

absl::Status Refused(const std::string& path, absl::string_view why) {
  return absl::InvalidArgumentError(absl::StrCat(path, " ", why));
}

// Where the bytes go in the end: links are followed.
struct Destination {
  std::string path;
  bool exists = false;
  struct stat info = {};

  bool regular() const { return !exists || S_ISREG(info.st_mode); }
};

absl::StatusOr<Destination> Resolve(const std::string& path) {
  Destination destination;
  destination.path = path;
  if (::stat(path.c_str(), &destination.info) == 0) {
    destination.exists = true;
    // What is no regular file is opened by the name that it has: /dev/fd/3 leads to no other.
    if (!S_ISREG(destination.info.st_mode)) return destination;
    const std::unique_ptr<char, void (*)(void*)> real(::realpath(path.c_str(), nullptr), std::free);
    if (real == nullptr) return FileError(errno, path, "cannot be followed");
    destination.path = real.get();
    return destination;
  }
  if (errno != ENOENT) return FileError(errno, path, "cannot be written");
  // A link to what is not there yet.
  for (int links = 0; links < kMaxLinks; ++links) {
    std::error_code error;
    if (!fs::is_symlink(fs::symlink_status(destination.path, error))) return destination;
    const fs::path target = fs::read_symlink(destination.path, error);
    if (error) return FileError(error.value(), path, "cannot be followed");
    destination.path =
        target.is_absolute() ? target.string() : (fs::path(destination.path).parent_path() / target).string();
  }
  return FileError(ELOOP, path, "cannot be followed");
}

std::string FolderOf(const std::string& path) {
  const std::string folder = fs::path(path).parent_path().string();
  return folder.empty() ? "." : folder;
}

absl::Status CheckFolder(const std::string& path, std::string folder, bool makes_folders) {
  std::error_code error;
  while (makes_folders && !fs::exists(folder, error) && FolderOf(folder) != folder) folder = FolderOf(folder);
  if (!fs::exists(folder, error))
    return Refused(path, absl::StrCat("cannot be made: there is no folder ", folder));
  if (!fs::is_directory(folder, error))
    return Refused(path, absl::StrCat("cannot be made: ", folder, " is no folder"));
  // Only trying shows it: permissions, a read-only file system, and what root may not do either.
  const std::string probe = UnfinishedPathOf(folder + "/touchstone-probe");
  const int file = OpenFile(probe, O_WRONLY | O_CREAT | O_EXCL, 0600);
  if (file < 0) return Refused(path, absl::StrCat("cannot be made in ", folder, ": ", std::strerror(errno)));
  ::close(file);
  ::unlink(probe.c_str());
  return absl::OkStatus();
}

absl::Status CheckDestination(const OutputFile& output, const Destination& destination, bool force) {
  const std::string& path = output.path;
  if (!destination.exists) {
    if (output.kind != OutputKind::kFolder && fs::path(path).filename().empty())
      return Refused(path, "is the name of a folder; a file's was expected");
    return CheckFolder(path, FolderOf(destination.path),
                       output.makes_folders || output.kind == OutputKind::kFolder);
  }
  const mode_t mode = destination.info.st_mode;
  if (output.kind == OutputKind::kFolder)
    return S_ISDIR(mode) ? CheckFolder(path, path, false) : Refused(path, "is no folder; one was expected");
  if (S_ISDIR(mode)) return Refused(path, "is a folder; a file's name was expected");
  if (S_ISBLK(mode)) return Refused(path, "is a block device, whose content would be destroyed");
  if (S_ISSOCK(mode)) return Refused(path, "is a socket, which cannot be written to");
  if (::access(path.c_str(), W_OK) != 0)
    return Refused(path, absl::StrCat("may not be written: ", std::strerror(errno)));
  if (!S_ISREG(mode) || output.kind == OutputKind::kJournal) return absl::OkStatus();
  if (!force)
    return absl::AlreadyExistsError(
        absl::StrCat(path, " exists already; choose another name, or --force to replace it"));
  return CheckFolder(path, FolderOf(destination.path), false);
}

// Nothing is lost when a terminal or /dev/null is written to twice, or read as well.
bool HoldsNothing(const Destination& destination) {
  return destination.exists && S_ISCHR(destination.info.st_mode);
}

// Whether two paths lead to one file, be it through links, or would if it were there.
bool SameFile(const Destination& a, const Destination& b) {
  if (a.exists != b.exists) return false;
  if (a.exists) return a.info.st_dev == b.info.st_dev && a.info.st_ino == b.info.st_ino;
  std::error_code error;
  return fs::weakly_canonical(fs::absolute(a.path, error), error) ==
         fs::weakly_canonical(fs::absolute(b.path, error), error);
}

absl::Status WithOption(const std::string& option, const absl::Status& status) {
  return absl::Status(status.code(), absl::StrCat(option, ": ", status.message()));
}

// --- Writing

class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  int number() const { return number_; }

 private:
  int number_;
};

// A new file with what the umask leaves of these permission bits.
absl::Status MakeFile(const std::string& path, absl::string_view data, mode_t mode) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::unique_ptr<FileWriter> file, FileWriter::Create(path, mode));
  TOUCHSTONE_RETURN_IF_ERROR(file->Write(data));
  return file->Close();
}

// Renames unless something stands there; EEXIST then.
int RenameToNew(const char* from, const char* to) {
  if (::renameat2(AT_FDCWD, from, AT_FDCWD, to, RENAME_NOREPLACE) == 0) return 0;
  if (errno != EINVAL && errno != ENOSYS) return errno;
  // A file system that cannot: a second name does the same.
  if (::link(from, to) != 0) return errno;
  ::unlink(from);
  return 0;
}

absl::Status MoveIntoPlace(const std::string& part, const std::string& path, const Destination& destination,
                           bool force, std::optional<mode_t> bits) {
  if (!force) {
    const int failed = RenameToNew(part.c_str(), destination.path.c_str());
    if (failed == EEXIST)
      return absl::AlreadyExistsError(absl::StrCat(
          path, " exists now, though it did not when the command began; what it should have had is in ",
          part));
    return failed == 0 ? SyncFolderOf(destination.path)
                       : FileError(failed, path, "cannot be renamed into place");
  }
  if (destination.exists) {
    // The file stays its owner's where we may say so; then its bits, which a change of owner clears.
    if (::chown(part.c_str(), destination.info.st_uid, destination.info.st_gid) != 0) errno = 0;
    if (::chmod(part.c_str(), bits.value_or(destination.info.st_mode & 07777)) != 0)
      return FileError(errno, path, "its permission bits cannot be kept");
  }
  return RenameSynced(part, destination.path);
}

// A FIFO, a terminal, /dev/null: opened as it is, never made, cut or replaced.
absl::StatusOr<std::unique_ptr<Descriptor>> OpenSpecial(const std::string& path) {
  auto file = std::make_unique<Descriptor>(OpenFile(path, O_WRONLY | O_NOCTTY));
  struct stat info;
  if (file->number() < 0 || ::fstat(file->number(), &info) != 0)
    return FileError(errno, path, "cannot be opened");
  if (S_ISREG(info.st_mode) || S_ISBLK(info.st_mode)) return Refused(path, "has become another file");
  return file;
}

absl::Status CopyTo(const std::string& from, int descriptor, const std::string& path) {
  const Descriptor file(OpenFile(from, O_RDONLY));
  if (file.number() < 0) return FileError(errno, from, "cannot be read again");
  std::string block(kBlockBytes, '\0');
  for (ssize_t got = 1; got > 0;) {
    got = ::read(file.number(), block.data(), block.size());
    if (got < 0) return FileError(errno, from, "reading failed");
    TOUCHSTONE_RETURN_IF_ERROR(WriteAll(descriptor, path, {block.data(), static_cast<size_t>(got)}));
  }
  return absl::OkStatus();
}

absl::Status WriteBeside(const std::string& path, const Destination& destination, bool force,
                         const std::function<absl::Status(const std::string&)>& write,
                         std::optional<mode_t> bits = std::nullopt) {
  const std::string part = UnfinishedPathOf(destination.path);
  absl::Status status = write(part);
  if (!status.ok()) {
    ::unlink(part.c_str());
    return absl::Status(status.code(), absl::StrReplaceAll(status.message(), {{part, path}}));
  }
  status = MoveIntoPlace(part, path, destination, force, bits);
  if (!status.ok() && !absl::IsAlreadyExists(status)) ::unlink(part.c_str());
  return status;
}

}  // namespace

bool IsStandardOutput(const std::string& path) {
  return path == "-" || path == "/dev/stdout";
}

absl::Status CheckOutputFiles(const std::vector<OutputFile>& outputs, const std::vector<std::string>& inputs,
                              bool force) {
  std::vector<std::pair<const OutputFile*, Destination>> checked;
  const OutputFile* on_stdout = nullptr;
  for (const OutputFile& output : outputs) {
    if (output.path.empty()) continue;
    if (IsStandardOutput(output.path)) {
      if (output.kind != OutputKind::kFile)
        return absl::InvalidArgumentError(
            absl::StrCat(output.option, ": ", output.kind == OutputKind::kFolder ? "a folder" : "a journal",
                         " cannot go to standard output"));
      if (on_stdout != nullptr)
        return absl::InvalidArgumentError(
            absl::StrCat(output.option, " and ", on_stdout->option, ": both are standard output"));
      on_stdout = &output;
      continue;
    }
    absl::StatusOr<Destination> destination = Resolve(output.path);
    if (!destination.ok()) return WithOption(output.option, destination.status());
    if (!HoldsNothing(*destination)) {
      // Before --force is offered: it would not help.
      for (const std::string& input : inputs) {
        if (input.empty() || input == "-") continue;
        const absl::StatusOr<Destination> read = Resolve(input);
        if (read.ok() && read->exists && SameFile(*read, *destination))
          return absl::InvalidArgumentError(
              absl::StrCat(output.option, ": ", output.path, " is ", input,
                           ", which is read and never changed; choose another name"));
      }
      for (const auto& [other, its_destination] : checked)
        if (SameFile(its_destination, *destination))
          return absl::InvalidArgumentError(absl::StrCat(output.option, " and ", other->option, ": both are ",
                                                         output.path, "; one would replace the other"));
    }
    const absl::Status status = CheckDestination(output, *destination, force);
    if (!status.ok()) return WithOption(output.option, status);
    checked.emplace_back(&output, *std::move(destination));
  }
  return absl::OkStatus();
}

absl::Status WriteOutputFile(const std::string& path, absl::string_view data, bool force,
                             std::optional<mode_t> bits) {
  if (path.empty() || IsStandardOutput(path)) {
    ProgressBar::ClearShown();
    ::fwrite(data.data(), 1, data.size(), stdout);  // Cli::Run reports what went wrong with it
    return absl::OkStatus();
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const Destination destination, Resolve(path));
  if (destination.regular())
    return WriteBeside(
        path, destination, force,
        [&](const std::string& part) {
          // What takes the place of another file gets its bits at the end, and shows nobody anything before.
          return MakeFile(part, data, destination.exists ? 0600 : bits.value_or(0666));
        },
        bits);
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto file, OpenSpecial(path));
  return WriteAll(file->number(), path, data);
}

absl::Status WriteOutputFileBy(const std::string& path, bool force,
                               const std::function<absl::Status(const std::string& free_path)>& write) {
  const bool to_stdout = path.empty() || IsStandardOutput(path);
  Destination destination;
  if (!to_stdout) {
    TOUCHSTONE_ASSIGN_OR_RETURN(destination, Resolve(path));
    if (destination.regular()) return WriteBeside(path, destination, force, write);
  }
  const std::string passing = UnfinishedPathOf((fs::temp_directory_path() / "touchstone-output").string());
  absl::Status status = write(passing);
  if (status.ok() && to_stdout) {
    ::fflush(stdout);
    status = CopyTo(passing, STDOUT_FILENO, "stdout");
  } else if (status.ok()) {
    const absl::StatusOr<std::unique_ptr<Descriptor>> file = OpenSpecial(path);
    status = file.ok() ? CopyTo(passing, (*file)->number(), path) : file.status();
  }
  ::unlink(passing.c_str());
  return absl::Status(status.code(),
                      absl::StrReplaceAll(status.message(), {{passing, to_stdout ? "stdout" : path}}));
}

}  // namespace touchstone::cli
