#include "server/gateway/bundle/make_bundle.h"

#include <absl/cleanup/cleanup.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>
#include <sys/utsname.h>

#include <toml++/toml.h>
#include <cstdlib>
#include <filesystem>
#include <tuple>

#include "server/base/files/file_writer.h"
#include "server/base/process/version.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/gateway/bundle/anonymous.h"
#include "server/gateway/bundle/bundle_file.h"
#include "server/gateway/bundle/bundle_names.h"

namespace touchstone::gateway::bundle {
namespace {

using Json = nlohmann::ordered_json;

constexpr uint64_t kMaxTextBytes = 64 << 20;

// What is made before it is packed, in a folder that goes.
class Parts {
 public:
  absl::Status Begin() {
    folder_ = (std::filesystem::temp_directory_path() / "touchstone_bundle_XXXXXX").string();
    if (::mkdtemp(folder_.data()) != nullptr) return absl::OkStatus();
    return FileError(errno, folder_, "cannot be made; TMPDIR names a folder with room for the bundle");
  }
  ~Parts() {
    std::error_code ignored;
    if (!folder_.empty()) std::filesystem::remove_all(folder_, ignored);
  }

  // The place of a member that is still to be made.
  std::string Add(const std::string& name) {
    const std::string path = absl::StrCat(folder_, "/", members_.size());
    members_.push_back({name, path});
    return path;
  }
  absl::Status AddText(const std::string& name, absl::string_view text) {
    return WriteFileAtomically(Add(name), text, 0600);
  }
  void AddFile(const std::string& name, const std::string& path) { members_.push_back({name, path}); }
  const std::vector<BundleMember>& members() const { return members_; }

 private:
  std::string folder_;
  std::vector<BundleMember> members_;
};

// "Debian GNU/Linux 12 (bookworm), Linux 6.1.0, x86_64"; no host's name.
std::string SystemInWords() {
  std::string name = "Linux";
  if (const absl::StatusOr<std::string> release = ReadFile("/etc/os-release", 1 << 16); release.ok())
    for (absl::string_view line : absl::StrSplit(*release, '\n'))
      if (absl::ConsumePrefix(&line, "PRETTY_NAME="))
        name = std::string(absl::StripPrefix(absl::StripSuffix(line, "\""), "\""));
  utsname facts{};
  if (uname(&facts) != 0) return name;
  return absl::StrCat(name, ", ", facts.sysname, " ", facts.release, ", ", facts.machine);
}

Json SessionInWords(const session::SessionContent& content) {
  Json session = {{"name", content.session.name},
                  {"source", content.session.provenance},
                  {"emulated", content.session.emulated},
                  {"fingers", content.session.fingers},
                  {"touches", content.touches.size()}};
  size_t failed = 0;
  for (const session::JournalTouch& touch : content.touches)
    failed += touch.stage == session::TouchStage::kFailed;
  session["failed"] = failed;
  session["pictures"] = content.images.size();
  session["objects"] = content.session.objects;
  return session;
}

absl::Status AddJournal(const session::SessionContent& content, Parts* parts) {
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const auto journal,
      session::Journal::Open(parts->Add(kBundleJournal), session::Journal::Mode::kCreateOrReadWrite));
  return journal->AddSession(content);
}

absl::Status AddModels(const std::vector<std::string>& models, Aliases* aliases, Parts* parts) {
  for (size_t k = 0; k < models.size(); ++k) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(models[k], kMaxTextBytes));
    TOUCHSTONE_RETURN_IF_ERROR(
        parts->AddText(absl::StrCat(kBundleModels, "/model-", k + 1, ".yaml"), aliases->Text(text)));
  }
  return absl::OkStatus();
}

absl::StatusOr<Json> AddMeshes(const std::vector<BundleRequest::Mesh>& meshes, Aliases* aliases,
                               Parts* parts) {
  Json list = Json::array();
  for (size_t k = 0; k < meshes.size(); ++k) {
    const std::string file = absl::StrCat(kBundleMeshes, "/mesh-", k + 1,
                                          std::filesystem::path(meshes[k].path).extension().string());
    if (!IsBundleName(file))
      return absl::InvalidArgumentError(
          absl::StrCat(meshes[k].path, ": the name of a mesh file ends in its format"));
    parts->AddFile(file, meshes[k].path);
    list.push_back(
        {{"object", aliases->Text(meshes[k].object)}, {"file", file}, {"options", meshes[k].options}});
  }
  return list;
}

}  // namespace

absl::Status TakeFilesOfConfig(BundleRequest* request) {
  if (request->config.empty()) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(request->config, 1 << 20));
  toml::table table;
  try {
    table = toml::parse(text);
  } catch (const toml::parse_error& error) {
    return absl::InvalidArgumentError(absl::StrCat(request->config, ":", error.source().begin.line, ": ",
                                                   std::string(error.description())));
  }
  const std::filesystem::path folder = std::filesystem::path(request->config).parent_path();
  for (const auto& [key, path, otherwise] : {std::tuple("journal", &request->journal, "rig.db"),
                                             std::tuple("audit_log", &request->audit_log, "rig.audit.jsonl")})
    if (path->empty()) *path = (folder / table[key].value_or(std::string(otherwise))).string();
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(request->audit_log, ignored)) request->audit_log.clear();
  return absl::OkStatus();
}

absl::StatusOr<Json> MakeBundle(const BundleRequest& request, const std::string& path) {
  session::SessionContent content;
  {
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto journal,
                                session::Journal::Open(request.journal, session::Journal::Mode::kReadOnly));
    TOUCHSTONE_ASSIGN_OR_RETURN(content, ReadContent(*journal, request.session, request.pictures));
  }
  // Every name first, wherever it stands, so that it has the same alias everywhere.
  Aliases aliases;
  aliases.LearnThisMachine();
  for (const std::string& name : request.hide) aliases.Learn(AliasKind::kHidden, name);
  if (request.session != "default") aliases.Learn(AliasKind::kSession, request.session);
  std::vector<Json> audit;
  if (!request.audit_log.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string log, ReadFile(request.audit_log, uint64_t{1} << 32));
    audit = LinesOf(log, content);
    LearnFrom(audit, &aliases);
  }
  std::string config;
  if (!request.config.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string toml, ReadFile(request.config, 1 << 20));
    TOUCHSTONE_ASSIGN_OR_RETURN(config, AnonymousConfig(toml, request.config, &aliases));
  }
  Anonymise(&content, &aliases);
  Anonymise(&audit, &aliases);
  Json state = request.state;
  Anonymise(&state, &aliases);
  for (std::string& object : content.session.objects) object = aliases.Text(object);

  Parts parts;
  TOUCHSTONE_RETURN_IF_ERROR(parts.Begin());
  TOUCHSTONE_RETURN_IF_ERROR(AddJournal(content, &parts));
  if (!audit.empty()) {
    std::string lines;
    for (const Json& line : audit)
      absl::StrAppend(&lines, line.dump(-1, ' ', false, Json::error_handler_t::replace), "\n");
    TOUCHSTONE_RETURN_IF_ERROR(parts.AddText(kBundleAudit, lines));
  }
  if (!config.empty()) TOUCHSTONE_RETURN_IF_ERROR(parts.AddText(kBundleConfig, config));
  if (!state.is_null())
    TOUCHSTONE_RETURN_IF_ERROR(
        parts.AddText(kBundleState, state.dump(1, ' ', false, Json::error_handler_t::replace) + "\n"));
  TOUCHSTONE_RETURN_IF_ERROR(AddModels(request.models, &aliases, &parts));
  TOUCHSTONE_ASSIGN_OR_RETURN(const Json meshes, AddMeshes(request.meshes, &aliases, &parts));

  Json manifest = {
      {"touchstone", kVersion}, {"system", SystemInWords()}, {"session", SessionInWords(content)}};
  manifest["seed"] = request.seed.has_value() ? Json(*request.seed) : Json();
  manifest["meshes"] = meshes;
  manifest["replaced"] = aliases.Counts();
  manifest["kept"] = {"names of objects and of covariates", "measurements, times and settings",
                      "serial ports", "what pictures show and mesh files hold"};
  return WriteBundle(path, manifest, parts.members());
}

}  // namespace touchstone::gateway::bundle
