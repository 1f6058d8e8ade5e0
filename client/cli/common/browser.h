// A page in the person's browser.
#pragma once

#include <string>
#include <utility>

#include <absl/status/statusor.h>

#include "client/cli/common/common.h"

namespace touchstone::cli {

// A file that only this user reads and that leads a browser to an address: what stands in the address is a secret, and command
// lines are read by every user of the machine. It goes with this object.
class RedirectFile {
 public:
  // In XDG_RUNTIME_DIR, TMPDIR or /tmp.
  static absl::StatusOr<RedirectFile> To(const std::string& address);
  RedirectFile() = default;
  RedirectFile(RedirectFile&& other) noexcept : path_(std::exchange(other.path_, "")) {}
  RedirectFile& operator=(RedirectFile&& other) noexcept {
    std::swap(path_, other.path_);
    return *this;
  }
  ~RedirectFile();
  const std::string& path() const { return path_; }

 private:
  std::string path_;  // empty: none
};

// Opens a file or an address with xdg-open; where there is none, says on stderr to open `instead`, or the same.
void OpenInBrowser(const Cli& cli, const std::string& page, const std::string& instead = "");

}  // namespace touchstone::cli
