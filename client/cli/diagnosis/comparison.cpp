#include "client/cli/diagnosis/comparison.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <random>

#include "client/cli/common/terminal.h"
#include "client/cli/session/images.h"
#include "client/cli/session/set_meshes.h"
#include "client/report/report.h"
#include "client/workbench/page.h"
#include "server/base/check.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/effects/all_effects.h"
#include "server/geometry/files/mesh_file.h"
#include "server/model/model.h"
#include "server/service/calls/evidence.h"
#include "server/session/measurements/touch_content.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kMaxTermsBytes = 1 << 20;
constexpr size_t kPiece = 1 << 20;

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
  if (options->takes_models) {
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
  }
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
    TOUCHSTONE_ASSIGN_OR_RETURN(const model::Model terms,
                                model::ParseModel(service::AsModelFile(text), path, effects::Catalogue()));
    if (terms.effects.empty())
      return absl::InvalidArgumentError(absl::StrCat(
          "--also: ", path, " has no effects; a file of formulas that may be missing was expected"));
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
    AppendObjects(own, &objects);
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
      AppendObjects(own, &objects);
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(meshes, MeshesOf(cli, objects, options.further_meshes));
  }
  if (served) TOUCHSTONE_RETURN_IF_ERROR(comparison->SendMeshes(meshes));
  comparison->meshes_ = std::move(meshes);
  NamedSet& first = sets[0];
  if (options.with_content_hash) {
    TOUCHSTONE_ASSIGN_OR_RETURN(comparison->content_sha256_, comparison->ContentSha256Of(first));
  }
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

absl::StatusOr<std::string> Comparison::ContentSha256Of(const NamedSet& set) const {
  if (set.measured) return session::TouchContentSha256(*set.measured);
  std::string csv = set.csv;
  if (!set.session.empty()) {
    std::string left_out;
    TOUCHSTONE_ASSIGN_OR_RETURN(const service::StoredSession stored,
                                FetchSession(connection_.get(), set.session, &left_out));
    csv = stored.csv;
  }
  if (csv.empty()) return set.images_sha256;
  TOUCHSTONE_ASSIGN_OR_RETURN(const session::MeasurementSet touches,
                              session::ParseMeasurementSet(csv, evidence_.origin()));
  return session::TouchContentSha256(touches);
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
  if (csv_to_send_ahead_.empty()) return absl::OkStatus();
  std::random_device random;
  const std::string name = absl::StrCat("sent-ahead-", absl::Hex(random()), absl::Hex(random()));
  grpc::ClientContext context;
  const Interrupt::Handler handler([&context] { context.TryCancel(); });
  TOUCHSTONE_RETURN_IF_ERROR(SendSession(&connection_->sessions(), name, &context));
  sent_ahead_ = name;
  evidence_.set_session(name);
  return absl::OkStatus();
}

absl::Status Comparison::SendAheadAgain(const std::shared_ptr<grpc::Channel>& server) const {
  if (sent_ahead_.empty())
    return absl::FailedPreconditionError("nothing was sent ahead: the measurements are in each request");
  const auto sessions = v1::Sessions::NewStub(server);
  grpc::ClientContext context;
  const absl::Status sent = SendSession(sessions.get(), sent_ahead_, &context);
  return absl::IsAlreadyExists(sent) ? absl::OkStatus() : sent;
}

absl::Status Comparison::SendSession(v1::Sessions::StubInterface* sessions, const std::string& name,
                                     grpc::ClientContext* context) const {
  const std::string& csv = csv_to_send_ahead_;
  v1::Session session;
  const auto writer = sessions->CreateSession(context, &session);
  v1::CreateSessionRequest request;
  request.set_name(name);
  for (size_t begin = 0; begin < csv.size(); begin += kPiece) {
    request.set_csv(csv.substr(begin, kPiece));
    if (!writer->Write(request)) break;
    request.clear_name();
  }
  writer->WritesDone();
  const absl::Status status = client::FromGrpc(writer->Finish());
  return WithFile(status, name, evidence_.origin());
}

absl::Status WithEffectHint(const absl::Status& status, const std::vector<std::string>& names) {
  std::vector<std::string> known;
  for (const auto& effect : effects::TouchEffects()) known.push_back(effect->name);
  for (const std::string& name : names) {
    const std::string hint = DidYouMean(name, known);
    if (!absl::StartsWith(status.message(), absl::StrCat("'", name, "' is no effect")) ||
        !absl::StrContains(hint, "did you mean '") || std::count(known.begin(), known.end(), name) > 0)
      continue;
    return absl::Status(status.code(), absl::StrCat("'", name, "' is no effect", hint));
  }
  return status;
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
