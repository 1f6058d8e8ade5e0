#include "client/cli/comparison.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <map>
#include <optional>
#include <random>
#include <set>

#include "client/cli/journal_session.h"
#include "client/cli/session_images.h"
#include "client/cli/terminal.h"
#include "client/report/report.h"
#include "client/workbench/page.h"
#include "server/base/check.h"
#include "server/base/status.h"
#include "server/base/text.h"
#include "server/effects/all_effects.h"
#include "server/geometry/mesh_file.h"
#include "server/model/model.h"
#include "server/service/evidence.h"
#include "server/service/measured_set_message.h"
#include "server/session/image_set_file.h"
#include "server/session/measurement_set.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kMaxTermsBytes = 1 << 20;
constexpr size_t kMaxInline = 16 << 20;  // a larger set is sent in pieces, as a session
constexpr size_t kPiece = 1 << 20;
// Of a folder with many meshes, those that the set does not name: so many are tried as what was touched.
constexpr size_t kMaxFurtherMeshes = 12;
constexpr uint64_t kMaxFurtherBytes = 32 << 20;

// A set as the user names it: its file's text, the name of a session that the server keeps, what a rig's journal
// holds, or the files of a folder of photographs (with the text of its touches.csv, if it has one).
struct NamedSet {
  std::string csv, session;
  std::optional<session::MeasurementSet> measured;
  std::optional<v1::ImageSetFiles> images;
  std::string images_sha256;
};

absl::StatusOr<NamedSet> ReadFolder(const std::string& folder) {
  NamedSet set;
  TOUCHSTONE_ASSIGN_OR_RETURN(set.images, session::ReadImageSetFiles(folder));
  if (session::HasTouches(folder)) {
    TOUCHSTONE_ASSIGN_OR_RETURN(set.csv, ReadFile((fs::path(folder) / session::kTouchesCsv).string()));
  }
  return set;
}

// What messages call it.
std::string OriginOf(const std::string& text, const NamedSet& set) {
  if (!set.session.empty()) return "";
  if (text == "-") return "stdin";
  return set.images ? (fs::path(text) / session::kTouchesCsv).string() : text;
}

// Puts the touches into the evidence; what is too large for one request stays in set->csv.
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

void AddObjects(const std::vector<std::string>& more, std::vector<std::string>* objects) {
  for (const std::string& object : more)
    if (std::find(objects->begin(), objects->end(), object) == objects->end()) objects->push_back(object);
}

// Its objects, those of the touches first. Reads all, so that errors name files here.
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
  AddObjects(read.objects, &objects);
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

// Meshes that the set does not name, as far as they can be read: nobody asked for them, so none stops the command.
void AddFurtherMeshes(const Cli& cli, const std::map<std::string, std::string>& paths,
                      std::map<std::string, source::MeshSpec>* meshes) {
  size_t taken = 0;
  uint64_t bytes = 0;
  std::vector<std::string> left_out;
  for (const auto& [name, path] : paths) {
    if (meshes->count(name) > 0) continue;
    std::error_code error;
    const uint64_t size = fs::file_size(path, error);
    if (error || taken == kMaxFurtherMeshes || bytes + size > kMaxFurtherBytes) {
      left_out.push_back(name);
      continue;
    }
    if (!geometry::ReadMeshFile(path).ok()) continue;
    bytes += size, ++taken;
    source::MeshSpec source;
    source.name = name;
    source.path = path;
    meshes->emplace(name, source);
  }
  if (!left_out.empty())
    cli.Detail(absl::StrCat("--mesh-dir: ", left_out.size(), " further meshes (", left_out[0],
                            left_out.size() > 1 ? ", ..." : "",
                            ") are not tried as the mesh of another object; --mesh NAME=FILE adds one"));
}

// The mesh files of these objects in --mesh-dir. Other files there are left alone, or, with `further`, taken as far as
// the bounds allow.
absl::Status AddMeshesOfFolder(const Cli& cli, const std::string& folder,
                               const std::vector<std::string>& objects, bool further,
                               std::map<std::string, source::MeshSpec>* meshes) {
  const std::vector<std::string> formats = geometry::MeshFormatNames();
  std::map<std::string, std::string> paths, others;
  std::set<std::string> twice;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().stem().string();
    const std::string extension = absl::AsciiStrToLower(entry.path().extension().string());
    if (extension.empty() || std::find(formats.begin(), formats.end(), extension.substr(1)) == formats.end())
      continue;
    if (std::find(objects.begin(), objects.end(), name) == objects.end()) {
      others.emplace(name, entry.path().string());
      continue;
    }
    const auto [other, is_new] = paths.emplace(name, entry.path().string());
    if (is_new || meshes->count(name) > 0) continue;
    // The same object in two formats: the format that MeshFormatNames names first, and a note to the user.
    const auto rank = [&](const fs::path& path) {
      return std::find(formats.begin(), formats.end(),
                       absl::AsciiStrToLower(path.extension().string()).substr(1)) -
             formats.begin();
    };
    if (rank(entry.path()) < rank(other->second)) other->second = entry.path().string();
    twice.insert(name);
  }
  if (error) return absl::NotFoundError(absl::StrCat("--mesh-dir: '", folder, "': ", error.message()));
  for (const std::string& name : twice)
    cli.Log(absl::StrCat("note: --mesh-dir: several files are named '", name, "'; ", paths[name],
                         " is taken (--mesh ", name, "=FILE takes another)"));
  for (const auto& [name, path] : paths) {
    source::MeshSpec source;
    source.name = name;
    source.path = path;
    meshes->emplace(name, source);  // --mesh comes first
  }
  if (further) AddFurtherMeshes(cli, others, meshes);
  return absl::OkStatus();
}

// The meshes that the set's objects need, of those that the options name, and what --mesh names beside.
absl::StatusOr<std::vector<source::MeshSpec>> MeshesOf(const Cli& cli,
                                                       const std::vector<std::string>& objects,
                                                       bool further) {
  std::map<std::string, source::MeshSpec> meshes;
  for (const std::string& text : cli.source().meshes) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const source::MeshSpec source, service::ParseMeshSpec(text));
    if (!meshes.emplace(source.name, source).second)
      return absl::InvalidArgumentError(
          absl::StrCat("--mesh: two are named '", source.name, "'; one per object was expected"));
    if (std::find(objects.begin(), objects.end(), source.name) == objects.end()) {
      // Kept: it may be what was touched under another name.
      cli.Log(absl::StrCat("note: --mesh ", text, ": the set has no such object",
                           DidYouMean(source.name, objects)));
    }
  }
  if (!cli.source().mesh_folder.empty())
    TOUCHSTONE_RETURN_IF_ERROR(AddMeshesOfFolder(cli, cli.source().mesh_folder, objects, further, &meshes));
  std::vector<source::MeshSpec> list;
  for (const auto& [name, source] : meshes) list.push_back(source);
  return list;
}

// A model as the user names it; a file is read, so that errors name it.
absl::StatusOr<v1::ModelRef> ReadModel(const std::string& text) {
  TOUCHSTONE_ASSIGN_OR_RETURN(v1::ModelRef model, ParseModelRef(text));
  if (model.has_yaml())
    TOUCHSTONE_RETURN_IF_ERROR(model::ParseModel(model.yaml(), text, effects::Catalogue()).status());
  return model;
}

}  // namespace

void AddComparisonOptions(Cli* cli, CLI::App* command, ComparisonOptions* options, bool html) {
  const auto add_input = [&](const std::string& name, auto& value, const std::string& type,
                             const std::string& text) {
    CLI::Option* option = command->add_option(name, value, text)->type_name(type);
    cli->AddInput(command, option);
    return option;
  };
  if (options->takes_sets) {
    CLI::Option* set = add_input(
        options->set_name, options->sets, "",
        !options->set_text.empty()
            ? options->set_text
            : absl::StrCat(
                  "The measurement file (CSV), the folder of photographs (images.csv, camera.yaml and PNG "
                  "files; with a touches.csv in it `compare` and `diagnose` take both), or the journal "
                  "(.db) of a rig's session; -: stdin; with --server also a stored session's name",
                  options->max_sets > 1 ? ". Of touches, several: sessions of one rig, in the order "
                                          "in which they were made"
                                        : ""));
    set->required(options->set_required)->expected(options->set_required ? 1 : 0, options->max_sets);
  }
  CLI::Option* model = add_input(
      "--model", options->models, "MODEL",
      options->max_models > 1
          ? "Model file, name or hash. Default: the source's own. Given twice: which of the two errs less"
          : "Model file, name or hash. Default: the source's own");
  model->take_all()->expected(1);
  add_input("--also", options->also, "FILE",
            "A file of your own effects (formulas) that compete with the catalogue, repeatable")
      ->take_all()
      ->expected(1);
  command->add_option("--seed", options->seed, "Seed of permutations and draws. Default: 0")->type_name("N");
  if (html)
    cli->AddOutput(command, "--html", &options->html, "Write the report as one HTML file that opens offline");
  if (html || options->set_required)
    cli->AddOutput(command, "--json", &options->json,
                   "Write the report as JSON; -: to stdout, in place of the report in words")
        ->group("Output");
  cli->AddSourceOptions(command);
}

absl::Status CheckNoMeshes(const Cli& cli, const std::vector<std::pair<std::string, std::string>>& outputs) {
  const std::string& folder = cli.source().mesh_folder;
  if (folder.empty()) return absl::OkStatus();
  const std::vector<std::string> formats = geometry::MeshFormatNames();
  for (const auto& [option, path] : outputs) {
    if (path.empty() || IsStandardOutput(path)) continue;
    std::error_code error;
    const fs::path parent = fs::path(path).has_parent_path() ? fs::path(path).parent_path() : fs::path(".");
    const std::string extension = absl::AsciiStrToLower(fs::path(path).extension().string());
    if (fs::equivalent(parent, folder, error) && !extension.empty() &&
        std::find(formats.begin(), formats.end(), extension.substr(1)) != formats.end())
      return absl::InvalidArgumentError(
          absl::StrCat(option, ": ", path, " would be a mesh of --mesh-dir; choose another name"));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<Comparison>> Comparison::Open(const Cli& cli,
                                                             const ComparisonOptions& options) {
  if (static_cast<int>(options.models.size()) > options.max_models)
    return absl::InvalidArgumentError(absl::StrCat("--model: given ", options.models.size(), " times; ",
                                                   options.max_models == 1 ? "once" : "once or twice",
                                                   " was expected"));
  // Said before an hour of diagnosis, not after.
  if (const absl::Status page = workbench::PageTemplate().status(); !options.html.empty() && !page.ok())
    return absl::Status(page.code(), absl::StrCat("--html: ", page.message()));
  std::unique_ptr<Comparison> comparison(new Comparison(cli));
  v1::Evidence& evidence = comparison->evidence_;
  evidence.set_seed(options.seed);
  // Files are checked here, so that errors name them.
  TOUCHSTONE_ASSIGN_OR_RETURN(*evidence.mutable_model(), ReadModel(options.model()));
  if (options.models.size() > 1) {
    TOUCHSTONE_ASSIGN_OR_RETURN(comparison->other_model_, ReadModel(options.models[1]));
  }
  for (const std::string& path : options.also) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(path, kMaxTermsBytes));
    TOUCHSTONE_RETURN_IF_ERROR(
        model::ParseModel(service::AsModelFile(text), path, effects::Catalogue()).status());
    evidence.add_also_yaml(text);
  }
  std::vector<NamedSet> sets;
  for (const std::string& text : options.sets) {
    TOUCHSTONE_ASSIGN_OR_RETURN(sets.emplace_back(), ReadSet(cli, text));
    if (sets.size() > 1) {
      if (sets[0].images || sets.back().images)
        return absl::InvalidArgumentError(
            "SET: several sets are sessions of touches; photographs are diagnosed one folder at a time");
      comparison->further_.emplace_back().set_origin(OriginOf(text, sets.back()));
    }
  }
  evidence.set_origin(OriginOf(options.set(), sets[0]));
  const bool served = !cli.source().servers.empty();
  // Meshes of a stored session's objects are looked up once the server has said which these are.
  std::vector<std::string> objects;
  const bool has_meshes = !cli.source().meshes.empty() || !cli.source().mesh_folder.empty();
  for (size_t i = 0; i < sets.size(); ++i) {
    if (!sets[i].session.empty() || !(sets[i].images || has_meshes)) continue;
    const std::string origin = i == 0 ? evidence.origin() : comparison->further_[i - 1].origin();
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<std::string> own, ObjectsOf(origin, &sets[i]));
    AddObjects(own, &objects);
  }
  std::vector<source::MeshSpec> meshes;
  const bool stored =
      std::any_of(sets.begin(), sets.end(), [](const NamedSet& set) { return !set.session.empty(); });
  if (!objects.empty() && !stored) {
    TOUCHSTONE_ASSIGN_OR_RETURN(meshes, MeshesOf(cli, objects, options.further_meshes));
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(comparison->connection_,
                              cli.ConnectWithMeshes(served ? std::vector<source::MeshSpec>() : meshes));
  if (stored) {
    for (const NamedSet& set : sets) {
      if (set.session.empty()) continue;
      TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<std::string> own,
                                  comparison->ObjectsOfStored(set.session));
      AddObjects(own, &objects);
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(meshes, MeshesOf(cli, objects, options.further_meshes));
  }
  if (served) TOUCHSTONE_RETURN_IF_ERROR(comparison->SendMeshes(meshes));
  comparison->meshes_ = std::move(meshes);
  NamedSet& first = sets[0];
  if (!first.csv.empty() && !first.images) comparison->set_sha256_ = Sha256Hex(first.csv);
  if (first.images) {
    comparison->set_sha256_ = first.images_sha256;
    TOUCHSTONE_RETURN_IF_ERROR(comparison->AddImages(*std::move(first.images)));
    if (first.csv.empty()) return comparison;
  }
  TOUCHSTONE_RETURN_IF_ERROR(SetMeasurements(options.set(), &first, &evidence));
  comparison->csv_to_send_ahead_ = std::move(first.csv);
  size_t bytes = evidence.ByteSizeLong();
  for (size_t i = 1; i < sets.size(); ++i) {
    v1::Evidence& further = comparison->further_[i - 1];
    TOUCHSTONE_RETURN_IF_ERROR(SetMeasurements(options.sets[i], &sets[i], &further));
    bytes += further.ByteSizeLong() + sets[i].csv.size();
    if (!sets[i].csv.empty() || bytes > static_cast<size_t>(client::kMaxMessageBytes))
      return absl::InvalidArgumentError(absl::StrCat(
          "SET: with ", options.sets[i], " the sessions have ", bytes >> 20,
          " MiB, too much for one request (", client::kMaxMessageBytes >> 20, " MiB, and ", kMaxInline >> 20,
          " MiB of one session after the first); give stored sessions of a --server (`touchstone session "
          "import`), or fewer"));
  }
  return comparison;
}

absl::StatusOr<std::vector<std::string>> Comparison::ObjectsOfStored(const std::string& session) {
  v1::GetSessionRequest request;
  request.set_name(session);
  const absl::StatusOr<v1::Session> stored = connection_->Call(&v1::Sessions::Stub::GetSession, request);
  if (absl::IsNotFound(stored.status()))
    return absl::NotFoundError(
        absl::StrCat("SET: ", session, " is no file, and at the server ", stored.status().message()));
  TOUCHSTONE_RETURN_IF_ERROR(stored.status());
  return std::vector<std::string>(stored->objects().begin(), stored->objects().end());
}

Comparison::~Comparison() {
  if (sent_ahead_.empty()) return;
  v1::DeleteSessionRequest request;
  request.set_name(sent_ahead_);
  const auto deleted = connection_->CallOnce(&v1::Sessions::Stub::DeleteSession, request);
  if (!deleted.ok())
    cli_.Detail(
        absl::StrCat("session ", sent_ahead_, " is left at the server: ", deleted.status().message()));
}

absl::Status Comparison::SendMeshes(const std::vector<source::MeshSpec>& meshes) {
  if (meshes.empty()) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::ListObjectsResponse served,
                              connection_->Call(&v1::Source::Stub::ListObjects, v1::ListObjectsRequest()));
  std::map<std::string, std::string> hashes;
  for (const v1::Object& object : served.objects()) hashes[object.name()] = object.mesh_hash();
  for (const source::MeshSpec& source : meshes) {
    geometry::MeshImport import;
    import.unit = source.unit;
    import.up = source.up;
    import.scale = source.scale;
    if (source.fit_mm > 0) import.fit_mm = source.fit_mm;
    TOUCHSTONE_ASSIGN_OR_RETURN(const geometry::TriangleMesh mesh,
                                geometry::ReadMeshFile(source.path, import));
    if (hashes[source.name] == geometry::MeshHash(mesh)) continue;
    cli_.Detail(absl::StrCat("sending ", source.path, ": the server lacks it"));
    v1::MeshFile* file = evidence_.add_meshes();
    file->set_name(source.name);
    // What was read above has a format, a unit and an axis of these names.
    const auto named = [](const std::string& name) { return absl::AsciiStrToUpper(name); };
    v1::MeshFile::Format format;
    v1::MeshFile::LengthUnit unit;
    v1::MeshFile::Axis up;
    TOUCHSTONE_ASSIGN_OR_RETURN(*file->mutable_data(), ReadFile(source.path));
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string format_name,
                                geometry::MeshFormatOf(source.path, file->data()));
    TOUCHSTONE_CHECK(v1::MeshFile::Format_Parse(named(format_name), &format));
    TOUCHSTONE_CHECK(v1::MeshFile::LengthUnit_Parse(named(source.unit), &unit));
    TOUCHSTONE_CHECK(v1::MeshFile::Axis_Parse(named(source.up), &up));
    file->set_format(format);
    file->set_unit(unit);
    file->set_up(up);
    file->set_scale(source.scale);
    file->set_fit_mm(source.fit_mm);
  }
  const size_t bytes = evidence_.ByteSizeLong();
  if (bytes + kMaxInline > static_cast<size_t>(client::kMaxMessageBytes))
    return absl::InvalidArgumentError(absl::StrCat(
        "--mesh: the meshes have ", bytes >> 20,
        " MiB, too much for one request; give them to touchstone-server (the same option there)"));
  return absl::OkStatus();
}

absl::Status Comparison::AddImages(v1::ImageSetFiles images) {
  const size_t bytes = images.ByteSizeLong();
  if (bytes + evidence_.ByteSizeLong() + kMaxInline > static_cast<size_t>(client::kMaxMessageBytes))
    return absl::InvalidArgumentError(absl::StrCat(
        "SET: the pictures of ", images.origin(), " have ", bytes >> 20, " MiB, too much for one request (",
        client::kMaxMessageBytes >> 20, " MiB with everything); diagnose a part of them"));
  *evidence_.mutable_images() = std::move(images);
  return absl::OkStatus();
}

absl::Status Comparison::SendAhead() {
  const std::string& csv = csv_to_send_ahead_;
  if (csv.empty()) return absl::OkStatus();
  std::random_device random;
  const std::string name = absl::StrCat("sent-ahead-", absl::Hex(random()), absl::Hex(random()));
  grpc::ClientContext context;
  const Interrupt::Handler handler([&context] { context.TryCancel(); });
  v1::Session session;
  const auto writer = connection_->sessions().CreateSession(&context, &session);
  v1::CreateSessionRequest request;
  request.set_name(name);
  for (size_t begin = 0; begin < csv.size(); begin += kPiece) {
    request.set_csv(csv.substr(begin, kPiece));
    if (!writer->Write(request)) break;
    request.clear_name();
  }
  writer->WritesDone();
  const absl::Status status = client::FromGrpc(writer->Finish());
  if (!status.ok()) {
    // The server knows the set by the passing name only.
    std::string message(status.message());
    if (absl::StartsWith(message, name)) message = evidence_.origin() + message.substr(name.size());
    return absl::Status(status.code(), message);
  }
  sent_ahead_ = name;
  evidence_.set_session(name);
  return absl::OkStatus();
}

absl::Status WriteReportFiles(const Cli& cli, const ComparisonOptions& options, const v1::Report& report) {
  if (!options.html.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string page, client::HtmlReport(report));
    TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.html, page));
    cli.LogWritten(options.html);
  }
  if (options.json.empty()) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(std::string json, client::JsonReport(report));
  if (!absl::EndsWith(json, "\n")) json += '\n';
  TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.json, json));
  cli.LogWritten(options.json);
  return absl::OkStatus();
}

absl::Status PrintReport(const Cli& cli, const ComparisonOptions& options, const v1::Report& report) {
  TOUCHSTONE_RETURN_IF_ERROR(WriteReportFiles(cli, options, report));
  if (options.ReportOnStdout()) return absl::OkStatus();
  return cli.Print(client::TerminalReport(report, TerminalWidth(), ColourOnStdout()));
}

}  // namespace touchstone::cli
