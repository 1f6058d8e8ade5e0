// Every file that a command writes is checked and written here, so that nothing of the user's is destroyed:
//
//   - an existing file is replaced with --force only: whole or not at all, keeping its permission bits
//   - a file that the same command reads, or that another output of it names, is never written
//   - a symbolic link is followed and stays; what is no regular file (a FIFO, a terminal, /dev/null) is written
//     into and never replaced
//   - "-" is standard output
//
// Not for what has rules of its own because the same command resumes it: journals (.db) and dataset folders.
// Those are only checked here.
#pragma once

#include <sys/types.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/strings/string_view.h>

namespace touchstone::cli {

enum class OutputKind {
  kFile,     // written whole, at the end
  kJournal,  // an existing one is resumed or added to
  kFolder,   // made if it is not there; what it holds is the command's to check
  kPrefix,   // names of files are made from it; the command checks those
};

// An output as the user named it.
struct OutputFile {
  std::string option;  // "--html": the beginning of error messages
  std::string path;    // empty: not asked for; "-": standard output
  OutputKind kind = OutputKind::kFile;
  bool makes_folders = false;  // the command makes missing folders above it
};

// Whether the path means standard output: "-" or /dev/stdout.
bool IsStandardOutput(const std::string& path);

// To be called before the work. `inputs`: paths of files that the command reads; "-", empty ones and those
// that are not there are passed over. Errors, all of exit code 2: ALREADY_EXISTS without `force`;
// INVALID_ARGUMENT for what can never be written (an input, the same output twice, a folder, a block device, a
// missing or unwritable folder).
absl::Status CheckOutputFiles(const std::vector<OutputFile>& outputs, const std::vector<std::string>& inputs,
                              bool force);

// Writes an output. Empty and "-" are standard output. If a file came to stand there since the check, it is not
// replaced without `force`: ALREADY_EXISTS then names the file beside it that has the data. `bits`: its permission bits, if not
// those of the file that it replaces or what the umask leaves.
absl::Status WriteOutputFile(const std::string& path, absl::string_view data, bool force,
                             std::optional<mode_t> bits = std::nullopt);

// The same for data that a library writes to a path of its own (HDF5): `write` is given a path that is free and
// must make the file there.
absl::Status WriteOutputFileBy(const std::string& path, bool force,
                               const std::function<absl::Status(const std::string& free_path)>& write);

}  // namespace touchstone::cli
