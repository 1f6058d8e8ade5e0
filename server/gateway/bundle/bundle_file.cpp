#include "server/gateway/bundle/bundle_file.h"

#include <absl/cleanup/cleanup.h>
#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <archive.h>
#include <archive_entry.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "server/base/files/file_writer.h"
#include "server/base/status.h"
#include "server/base/text/printable.h"
#include "server/base/text/text.h"

namespace touchstone::gateway::bundle {
namespace {

constexpr char kManifest[] = "manifest.json";
constexpr char kFormat[] = "touchstone bundle";
constexpr int kFormatVersion = 1;
constexpr size_t kBlockBytes = 1 << 16;

// What the manifest says of a member.
struct Listed {
  uint64_t bytes = 0;
  std::string sha256;
  bool found = false;
};

std::string ArchiveText(archive* archive) {
  const char* text = archive_error_string(archive);
  return text == nullptr ? "unknown error of libarchive" : text;
}

// --- Writing

// Where libarchive's blocks go.
struct Sink {
  std::unique_ptr<FileWriter> file;
  absl::Status status;

  static la_ssize_t Write(archive* tar, void* self, const void* data, size_t size) {
    auto* const sink = static_cast<Sink*>(self);
    if (sink->status.ok()) sink->status = sink->file->Write({static_cast<const char*>(data), size});
    if (sink->status.ok()) return static_cast<la_ssize_t>(size);
    archive_set_error(tar, EIO, "writing failed");
    return -1;
  }
};

absl::Status AddHeader(archive* tar, archive_entry* entry, const std::string& name, uint64_t bytes) {
  archive_entry_clear(entry);
  archive_entry_set_pathname(entry, name.c_str());
  archive_entry_set_size(entry, static_cast<la_int64_t>(bytes));
  archive_entry_set_filetype(entry, AE_IFREG);
  archive_entry_set_perm(entry, 0644);
  archive_entry_set_mtime(entry, 0, 0);
  if (archive_write_header(tar, entry) == ARCHIVE_OK) return absl::OkStatus();
  return absl::InternalError(absl::StrCat(name, ": ", ArchiveText(tar)));
}

absl::Status AddBytes(archive* tar, const std::string& name, absl::string_view bytes) {
  if (archive_write_data(tar, bytes.data(), bytes.size()) == static_cast<la_ssize_t>(bytes.size()))
    return absl::OkStatus();
  return absl::InternalError(absl::StrCat(name, ": ", ArchiveText(tar)));
}

absl::Status AddFile(archive* tar, archive_entry* entry, const BundleMember& member, uint64_t bytes) {
  TOUCHSTONE_RETURN_IF_ERROR(AddHeader(tar, entry, member.name, bytes));
  std::ifstream file(member.path, std::ios::binary);
  std::string block(kBlockBytes, '\0');
  for (uint64_t left = bytes; left > 0;) {
    const uint64_t part = std::min<uint64_t>(left, block.size());
    if (!file.read(block.data(), static_cast<std::streamsize>(part)))
      return absl::DataLossError(absl::StrCat(member.path, ": became shorter while it was read"));
    TOUCHSTONE_RETURN_IF_ERROR(AddBytes(tar, member.name, absl::string_view(block).substr(0, part)));
    left -= part;
  }
  return absl::OkStatus();
}

// --- Reading

absl::Status Refused(const std::string& path, absl::string_view what) {
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": ", what, "; a bundle is what touchstone rig bundle writes"));
}

absl::Status CutOff(const std::string& path, const std::string& where, archive* tar) {
  return absl::DataLossError(absl::StrCat(path, ": ", where, " is cut off or damaged (", ArchiveText(tar),
                                          "); get the file again, whole"));
}

// A name as it may stand in a message.
std::string Shown(const char* name) {
  return name == nullptr ? "without a name" : absl::StrCat("'", Printable(name, 80), "'");
}

absl::StatusOr<std::string> ReadManifest(const std::string& path, archive* tar, archive_entry* entry) {
  if (archive_entry_size(entry) > static_cast<la_int64_t>(kMaxManifestBytes))
    return Refused(path, absl::StrCat("its manifest has ", archive_entry_size(entry), " bytes; at most ",
                                      kMaxManifestBytes, " are read"));
  std::string text(static_cast<size_t>(archive_entry_size(entry)), '\0');
  const la_ssize_t got = archive_read_data(tar, text.data(), text.size());
  if (got < 0 || static_cast<size_t>(got) != text.size()) return CutOff(path, kManifest, tar);
  return text;
}

absl::Status TakeManifest(const std::string& path, const nlohmann::json& manifest,
                          std::map<std::string, Listed>* listed, std::vector<std::string>* names) {
  if (!manifest.is_object() || manifest.value("format", nlohmann::json()) != kFormat)
    return Refused(path, absl::StrCat(kManifest, " does not say that this is a ", kFormat));
  if (manifest.value("format_version", nlohmann::json()) != kFormatVersion)
    return Refused(path, absl::StrCat("is of another version than ", kFormatVersion,
                                      ", which this program reads; use a newer touchstone-gateway"));
  const nlohmann::json files = manifest.value("files", nlohmann::json());
  if (!files.is_array() || files.size() > kMaxBundleFiles)
    return Refused(path, absl::StrCat(kManifest, ": 'files' must be a list of at most ", kMaxBundleFiles));
  uint64_t bytes = 0;
  for (const nlohmann::json& file : files) {
    const bool whole = file.is_object() && file.contains("name") && file["name"].is_string() &&
                       file.contains("bytes") && file["bytes"].is_number_unsigned() &&
                       file.contains("sha256") && file["sha256"].is_string();
    if (!whole) return Refused(path, absl::StrCat(kManifest, ": a file has name, bytes and sha256"));
    const std::string name = file["name"];
    if (!IsBundleName(name) || name == kManifest ||
        !listed->emplace(name, Listed{file["bytes"], file["sha256"]}).second)
      return Refused(path, absl::StrCat(kManifest, ": ", Shown(name.c_str()),
                                        " is no file of a bundle, or stands twice"));
    names->push_back(name);
    const uint64_t length = file["bytes"];
    if (length > kMaxBundleBytes || (bytes += length) > kMaxBundleBytes)
      return Refused(path, absl::StrCat("unpacked it would have more than ", kMaxBundleBytes >> 30, " GiB"));
  }
  return absl::OkStatus();
}

// Exactly as many bytes as were listed, and of that hash.
absl::Status Unpack(const std::string& path, archive* tar, const std::string& name, const Listed& listed,
                    const std::string& to) {
  std::error_code ignored;
  std::filesystem::create_directories(std::filesystem::path(to).parent_path(), ignored);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::unique_ptr<FileWriter> file, FileWriter::Create(to, 0600));
  std::string block(kBlockBytes, '\0');
  uint64_t bytes = 0;
  while (true) {
    const la_ssize_t got = archive_read_data(tar, block.data(), block.size());
    if (got < 0) return CutOff(path, name, tar);
    if (got == 0) break;
    bytes += static_cast<uint64_t>(got);
    if (bytes > listed.bytes) break;
    TOUCHSTONE_RETURN_IF_ERROR(file->Write(absl::string_view(block).substr(0, static_cast<size_t>(got))));
  }
  TOUCHSTONE_RETURN_IF_ERROR(file->Close(/*sync=*/false));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string hex, Sha256HexOfFile(to));
  if (bytes != listed.bytes || hex != listed.sha256)
    return absl::DataLossError(
        absl::StrCat(path, ": ", name,
                     " is not what the manifest lists: its length or SHA-256 is another; get "
                     "the file again, whole"));
  return absl::OkStatus();
}

}  // namespace

bool IsBundleName(const std::string& name) {
  if (name.empty() || name.size() > 100 || std::count(name.begin(), name.end(), '/') > 1) return false;
  char before = '/';
  for (const char c : name) {
    const bool plain = absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-';
    if (!plain && (before == '/' || (c != '.' && c != '/'))) return false;
    before = c;
  }
  return before != '/';
}

absl::StatusOr<nlohmann::ordered_json> WriteBundle(const std::string& path,
                                                   const nlohmann::ordered_json& manifest,
                                                   const std::vector<BundleMember>& members) {
  nlohmann::ordered_json head = {{"format", kFormat}, {"format_version", kFormatVersion}};
  head.update(manifest);
  head["files"] = nlohmann::ordered_json::array();
  std::vector<uint64_t> lengths;
  uint64_t total = 0;
  for (const BundleMember& member : members) {
    std::error_code error;
    lengths.push_back(std::filesystem::file_size(member.path, error));
    if (error) return absl::NotFoundError(absl::StrCat(member.path, ": ", error.message()));
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string sha256, Sha256HexOfFile(member.path));
    head["files"].push_back({{"name", member.name}, {"bytes", lengths.back()}, {"sha256", sha256}});
    total += lengths.back();
  }
  if (total > kMaxBundleBytes)
    return absl::ResourceExhaustedError(absl::StrCat(
        "the bundle would have ", total >> 20, " MiB unpacked, and at most ", kMaxBundleBytes >> 20,
        " are opened again; leave the pictures out (--without-pictures)"));
  const std::string text = head.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";

  Sink sink;
  TOUCHSTONE_ASSIGN_OR_RETURN(sink.file, FileWriter::Create(path));
  archive* const tar = archive_write_new();
  archive_entry* const entry = archive_entry_new();
  const auto free_both = absl::MakeCleanup([&] {
    archive_entry_free(entry);
    archive_write_free(tar);
  });
  archive_write_set_format_ustar(tar);
  archive_write_add_filter_gzip(tar);
  archive_write_set_options(tar, "gzip:!timestamp");  // the same session gives the same bytes
  const absl::Status packed = [&]() -> absl::Status {
    if (archive_write_open(tar, &sink, nullptr, &Sink::Write, nullptr) != ARCHIVE_OK)
      return absl::InternalError(ArchiveText(tar));
    TOUCHSTONE_RETURN_IF_ERROR(AddHeader(tar, entry, kManifest, text.size()));
    TOUCHSTONE_RETURN_IF_ERROR(AddBytes(tar, kManifest, text));
    for (size_t k = 0; k < members.size(); ++k)
      TOUCHSTONE_RETURN_IF_ERROR(AddFile(tar, entry, members[k], lengths[k]));
    return archive_write_close(tar) == ARCHIVE_OK ? absl::OkStatus() : absl::InternalError(ArchiveText(tar));
  }();
  TOUCHSTONE_RETURN_IF_ERROR(sink.status);  // says more than libarchive's text
  TOUCHSTONE_RETURN_IF_ERROR(packed);
  TOUCHSTONE_RETURN_IF_ERROR(sink.file->Close());
  return head;
}

OpenedBundle::~OpenedBundle() {
  std::error_code ignored;
  if (!folder_.empty()) std::filesystem::remove_all(folder_, ignored);
}

bool OpenedBundle::Has(const std::string& name) const {
  return std::find(names_.begin(), names_.end(), name) != names_.end();
}

absl::StatusOr<std::unique_ptr<OpenedBundle>> OpenedBundle::Open(const std::string& path) {
  std::unique_ptr<OpenedBundle> opened(new OpenedBundle);
  std::string folder = (std::filesystem::temp_directory_path() / "touchstone_replay_XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr)
    return FileError(errno, folder, "cannot be made; TMPDIR names a folder with room for the bundle");
  opened->folder_ = folder;

  archive* const tar = archive_read_new();
  const auto free_it = absl::MakeCleanup([tar] { archive_read_free(tar); });
  archive_read_support_filter_gzip(tar);
  archive_read_support_format_tar(tar);
  if (archive_read_open_filename(tar, path.c_str(), kBlockBytes) != ARCHIVE_OK)
    return Refused(path, absl::StrCat("is no gzipped tar (", ArchiveText(tar), ")"));
  std::map<std::string, Listed> listed;
  for (bool first = true;; first = false) {
    archive_entry* entry = nullptr;
    const int read = archive_read_next_header(tar, &entry);
    if (read == ARCHIVE_EOF && !first) break;
    if (read != ARCHIVE_OK) {
      if (first) return Refused(path, absl::StrCat("is no gzipped tar (", ArchiveText(tar), ")"));
      return CutOff(path, "its table of files", tar);
    }
    const char* const given = archive_entry_pathname(entry);
    const std::string name = given == nullptr ? "" : given;
    if (!IsBundleName(name))
      return Refused(path, absl::StrCat("has a file ", Shown(given), ", which lies outside of a bundle"));
    if (archive_entry_filetype(entry) != AE_IFREG || archive_entry_hardlink(entry) != nullptr)
      return Refused(path, absl::StrCat("has ", Shown(given), ", which is no plain file"));
    if (first) {
      if (name != kManifest)
        return Refused(path, absl::StrCat("begins with ", Shown(given), " and not with ", kManifest));
      TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadManifest(path, tar, entry));
      opened->manifest_ = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
      TOUCHSTONE_RETURN_IF_ERROR(TakeManifest(path, opened->manifest_, &listed, &opened->names_));
      continue;
    }
    const auto found = listed.find(name);
    if (found == listed.end() || found->second.found)
      return Refused(path,
                     absl::StrCat("has ", Shown(given),
                                  found == listed.end() ? ", which its manifest does not list" : " twice"));
    found->second.found = true;
    TOUCHSTONE_RETURN_IF_ERROR(Unpack(path, tar, name, found->second, opened->PathOf(name)));
  }
  for (const auto& [name, file] : listed)
    if (!file.found)
      return absl::DataLossError(
          absl::StrCat(path, ": ", name, " is missing, which its manifest lists; get the file again, whole"));
  return opened;
}

bool LooksLikeBundle(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  char magic[2] = {0, 0};
  file.read(magic, sizeof magic);
  return magic[0] == '\x1f' && magic[1] == '\x8b';
}

}  // namespace touchstone::gateway::bundle
