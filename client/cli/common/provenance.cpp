#include "client/cli/common/provenance.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <absl/time/clock.h>
#include <absl/time/time.h>

#include <algorithm>

#include "server/base/process/version.h"
#include "server/base/text/text.h"

namespace touchstone::cli {
namespace {

bool IsPlain(absl::string_view word) {
  return !word.empty() && std::all_of(word.begin(), word.end(), [](char c) {
    return absl::ascii_isalnum(static_cast<unsigned char>(c)) || absl::StrContains("-_./,:=+@%", c);
  });
}

}  // namespace

std::string ShellWord(const std::string& word) {
  if (IsPlain(word)) return word;
  return absl::StrCat("'", absl::StrReplaceAll(word, {{"'", "'\\''"}}), "'");
}

std::string ShellCommand(int argc, const char* const* argv) {
  std::string text;
  for (int i = 0; i < argc; ++i) {
    std::string word = argv[i];
    // The program by its name: where it lies differs from machine to machine.
    if (i == 0) word = word.substr(word.rfind('/') + 1);
    absl::StrAppend(&text, i == 0 ? "" : " ", ShellWord(word));
  }
  return text;
}

std::string UtcNow() {
  return absl::FormatTime("%Y-%m-%dT%H:%M:%SZ", absl::Now(), absl::UTCTimeZone());
}

void AddClientProvenance(const std::string& command, const std::string& set_sha256,
                         const std::vector<source::MeshSpec>& meshes, v1::Report* report) {
  v1::Provenance* provenance = report->mutable_provenance();
  provenance->set_command(command);
  provenance->set_date(UtcNow());
  provenance->set_client_version(kVersion);
  if (!set_sha256.empty()) provenance->set_set_sha256(set_sha256);
  for (v1::MeshProvenance& mesh : *provenance->mutable_meshes()) {
    const auto file = std::find_if(meshes.begin(), meshes.end(),
                                   [&](const source::MeshSpec& spec) { return spec.name == mesh.object(); });
    if (file == meshes.end() || file->path.empty()) continue;
    mesh.set_path(file->path);
    if (const auto hash = Sha256HexOfFile(file->path); hash.ok()) mesh.set_file_sha256(*hash);
  }
}

}  // namespace touchstone::cli
