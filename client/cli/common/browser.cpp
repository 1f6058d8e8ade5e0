#include "client/cli/common/browser.h"

#include <absl/strings/str_replace.h>
#include <spawn.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

namespace touchstone::cli {

absl::StatusOr<RedirectFile> RedirectFile::To(const std::string& address) {
  std::string folder = "/tmp";
  for (const char* variable : {"TMPDIR", "XDG_RUNTIME_DIR"})
    if (const char* set = std::getenv(variable); set != nullptr && *set != '\0') folder = set;
  std::string path = absl::StrCat(folder, "/touchstone-workbench-XXXXXX.html");
  constexpr int kSuffix = 5;                          // ".html"
  const int file = ::mkstemps(path.data(), kSuffix);  // of mode 0600
  if (file < 0)
    return absl::UnavailableError(
        absl::StrCat("--open: cannot write into ", folder, ": ", std::strerror(errno)));
  RedirectFile redirect;
  redirect.path_ = path;
  const std::string safe =
      absl::StrReplaceAll(address, {{"&", "&amp;"}, {"\"", "&quot;"}, {"<", "&lt;"}, {">", "&gt;"}});
  const std::string text = absl::StrCat(
      "<!doctype html><meta charset=\"utf-8\"><title>Touchstone workbench</title>"
      "<meta http-equiv=\"refresh\" content=\"0;url=",
      safe, "\"><p><a href=\"", safe, "\">To the workbench</a></p>\n");
  const bool written = ::write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  ::close(file);
  if (!written)
    return absl::UnavailableError(absl::StrCat("--open: cannot write ", path, ": ", std::strerror(errno)));
  return redirect;
}

RedirectFile::~RedirectFile() {
  if (!path_.empty()) ::unlink(path_.c_str());
}

void OpenInBrowser(const Cli& cli, const std::string& page, const std::string& instead) {
  std::string program = "xdg-open", address = page;
  char* const arguments[] = {program.data(), address.data(), nullptr};
  pid_t child = 0;
  if (::posix_spawnp(&child, program.c_str(), nullptr, nullptr, arguments, environ) != 0)
    cli.Log(absl::StrCat("--open: there is no xdg-open here; open ", instead.empty() ? page : instead,
                         " in a browser"));
}

}  // namespace touchstone::cli
