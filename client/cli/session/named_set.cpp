#include "client/cli/session/named_set.h"

#include <absl/strings/match.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <iterator>

#include "client/cli/session/images.h"
#include "client/cli/session/journal_session.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/service/sessions/measured_set_message.h"
#include "server/session/images/image_set_file.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;

absl::StatusOr<NamedSet> ReadFolder(const std::string& folder) {
  NamedSet set;
  TOUCHSTONE_ASSIGN_OR_RETURN(set.images, session::ReadImageSetFiles(folder));
  if (session::HasTouches(folder)) {
    TOUCHSTONE_ASSIGN_OR_RETURN(set.csv, ReadFile((fs::path(folder) / session::kTouchesCsv).string()));
  }
  return set;
}

}  // namespace

std::string OriginOf(const std::string& text, const NamedSet& set) {
  if (!set.session.empty()) return "";
  if (text == "-") return "stdin";
  return set.images ? (fs::path(text) / session::kTouchesCsv).string() : text;
}

absl::Status SetMeasurements(const std::string& text, NamedSet* set, v1::Evidence* evidence) {
  if (!set->session.empty()) {
    evidence->set_session(set->session);
    return absl::OkStatus();
  }
  if (set->measured.has_value()) {
    *evidence->mutable_set() = service::ToProto(*set->measured);
    if (evidence->set().ByteSizeLong() <= kMaxInline) return absl::OkStatus();
    TOUCHSTONE_ASSIGN_OR_RETURN(set->csv, JournalCsv(text, ""));
  }
  if (set->csv.size() > kMaxInline) return absl::OkStatus();
  evidence->set_csv(std::move(set->csv));
  set->csv.clear();
  return absl::OkStatus();
}

void AppendObjects(const std::vector<std::string>& more, std::vector<std::string>* objects) {
  for (const std::string& object : more)
    if (std::find(objects->begin(), objects->end(), object) == objects->end()) objects->push_back(object);
}

absl::StatusOr<std::vector<std::string>> ObjectsOf(const std::string& origin, NamedSet* set) {
  std::vector<std::string> objects;
  if (set->measured.has_value()) objects = set->measured->objects;
  if (!set->csv.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const session::MeasurementSet read,
                                session::ParseMeasurementSet(set->csv, origin));
    objects = read.objects;
  }
  if (!set->images) return objects;
  TOUCHSTONE_ASSIGN_OR_RETURN(const session::ImageSet read, session::ParseImageSet(*set->images));
  set->images_sha256 = read.sha256;
  AppendObjects(read.objects, &objects);
  return objects;
}

absl::StatusOr<NamedSet> ReadSet(const Cli& cli, const std::string& text) {
  NamedSet set;
  if (text == "-") {
    set.csv.assign(std::istreambuf_iterator<char>(std::cin), {});
    return set;
  }
  if (std::error_code error; fs::is_directory(text, error)) return ReadFolder(text);
  if (IsHdf5Path(text)) {
    TOUCHSTONE_ASSIGN_OR_RETURN(service::StoredSession stored, ReadImageSession(text));
    set.images = std::move(stored.images), set.csv = std::move(stored.csv);
    return set;
  }
  // A rig's journal with one session is as good as its measurement file.
  if (IsJournalPath(text)) {
    TOUCHSTONE_ASSIGN_OR_RETURN(set.images, JournalPhotographs(cli, text));
    if (set.images) return set;
    TOUCHSTONE_ASSIGN_OR_RETURN(set.measured, JournalSet(text));
    return set;
  }
  std::error_code error;
  const bool looks_like_file = absl::StrContains(text, "/") || absl::EndsWith(text, ".csv");
  if (!cli.source().servers.empty() && !looks_like_file && !fs::exists(text, error)) {
    set.session = text;
    return set;
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(set.csv, ReadFile(text));
  return set;
}

}  // namespace touchstone::cli
