// touchstone rig bundle: a session as a bug report, which touchstone-gateway --replay serves again.
#include <absl/strings/str_join.h>
#include <absl/strings/strip.h>

#include <filesystem>

#include "client/cli/rig/rig.h"
#include "client/cli/session/journal_session.h"
#include "server/base/status.h"
#include "server/gateway/bundle/make_bundle.h"
#include "server/service/core/resources.h"

namespace touchstone::cli {
namespace {

struct BundleOptions {
  gateway::bundle::BundleRequest request;
  std::vector<std::string> meshes;
  std::string output;
  uint64_t seed = 0;
  bool without_pictures = false;
};

// "1 host, 2 persons".
std::string CountsInWords(const Json& counts) {
  std::vector<std::string> parts;
  for (const auto& [kinds, count] : counts.items()) {
    const std::string kind(absl::StripSuffix(kinds, "s"));
    parts.push_back(kind == kinds ? absl::StrCat(count.get<int>(), " ", kind)
                                  : Counted(count.get<uint64_t>(), kind, kinds));
  }
  return parts.empty() ? "nothing" : absl::StrJoin(parts, ", ");
}

absl::Status FindFiles(const BundleOptions& options, gateway::bundle::BundleRequest* request) {
  if (request->config.empty() && request->journal.empty())
    return absl::InvalidArgumentError(
        "--config or --journal is missing: a bundle is made on the gateway's machine, of the file that it "
        "was started with "
        "(--config rig.toml) or of its journal alone (--journal rig.db)");
  TOUCHSTONE_RETURN_IF_ERROR(gateway::bundle::TakeFilesOfConfig(request));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto journal, OpenJournal(request->journal));
  TOUCHSTONE_ASSIGN_OR_RETURN(const session::JournalSession session,
                              FindSession(*journal, request->journal, request->session, "--session NAME"));
  request->session = session.name;
  for (const std::string& text : options.meshes) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const source::MeshSpec mesh, service::ParseMeshSpec(text));
    const size_t comma = text.find(',');
    request->meshes.push_back(
        {mesh.name, mesh.path, comma == std::string::npos ? "" : text.substr(comma + 1)});
  }
  return absl::OkStatus();
}

absl::Status RunBundle(const Cli& cli, const BundleOptions& options, bool seeded) {
  gateway::bundle::BundleRequest request = options.request;
  TOUCHSTONE_RETURN_IF_ERROR(FindFiles(options, &request));
  request.pictures = !options.without_pictures;
  if (seeded) request.seed = options.seed;
  if (!cli.source().servers.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const RigConnection connected, ConnectToRig(cli));
    client::Connection* const connection = connected.connection.get();
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState rig, GetRig(connection));
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::State state,
                                connection->Call(&v1::Control::Stub::GetState, v1::GetStateRequest()));
    TOUCHSTONE_ASSIGN_OR_RETURN(request.state, RigJson(state, rig));
  }
  Json manifest;
  TOUCHSTONE_RETURN_IF_ERROR(WriteOutputFileBy(
      options.output, cli.output().force, [&](const std::string& free_path) -> absl::Status {
        TOUCHSTONE_ASSIGN_OR_RETURN(manifest, gateway::bundle::MakeBundle(request, free_path));
        return absl::OkStatus();
      }));
  if (cli.output().json) {
    PrintJson(manifest);
    return absl::OkStatus();
  }
  const Json& session = manifest["session"];
  const uint64_t pictures = session["pictures"].get<uint64_t>();
  std::error_code ignored;
  cli.LogWritten(
      options.output,
      absl::StrCat(" (", Rounded(std::filesystem::file_size(options.output, ignored) / 1024.0),
                   " KiB): ", Counted(session["touches"].get<uint64_t>(), "touch", "touches"), ", ",
                   session["failed"].get<uint64_t>(), " failed, ", Counted(pictures, "picture", "pictures")));
  std::vector<std::string> files;
  for (const Json& file : manifest["files"]) files.push_back(file["name"]);
  return cli.Print(absl::StrCat(
      "In it         ", absl::StrJoin(files, ", "), "\n", "Hidden        ",
      CountsInWords(manifest["replaced"]), "\nKept          ",
      absl::StrJoin(manifest["kept"].get<std::vector<std::string>>(), "; "), "\n",
      request.state.is_null() ? "Not in it     the rig's state: --server HOST:PORT asks the gateway for it\n"
                              : "",
      request.audit_log.empty()
          ? "Not in it     an audit log: of what failed, only each touch's last error is\n"
          : "",
      pictures > 0 ? "Look at the pictures before you send it; --without-pictures leaves them out.\n" : "",
      "Look through it before you send it (tar -xzf ", options.output,
      "); --hide NAME hides what a program cannot know.\nSee what others will see: touchstone-gateway "
      "--replay ",
      options.output, "\n"));
}

}  // namespace

void AddRigBundle(Cli* cli, CLI::App* group) {
  auto options = std::make_shared<BundleOptions>();
  auto seed = std::make_shared<CLI::Option*>(nullptr);
  CLI::App* command = cli->AddCommand(
      group, "bundle",
      "Packs a session of this rig for a bug report: what was touched, what failed and how the rig was set "
      "up, without names "
      "of people, hosts and files. touchstone-gateway --replay serves it again.",
      "touchstone rig bundle monday --config rig.toml --server 127.0.0.1:50061 -o bug.tar.gz\n"
      "touchstone rig bundle monday --journal rig.db -o bug.tar.gz        the journal is all that is left\n"
      "touchstone rig bundle monday --config rig.toml --model tips.yaml --hide Kestrel -o bug.tar.gz",
      [cli, options, seed] { return RunBundle(*cli, *options, (*seed)->count() > 0); });
  gateway::bundle::BundleRequest& request = options->request;
  command->add_option("SESSION", request.session, "Its name. Default: the journal's only one")->type_name("");
  cli->AddOutput(command, "-o,--output", &options->output, "The bundle (.tar.gz)")->required();
  cli->AddInput(command,
                command
                    ->add_option("--config", request.config,
                                 "The gateway's file: it names journal and audit log, and goes along")
                    ->type_name("FILE"));
  cli->AddInput(command,
                command->add_option("--journal", request.journal, "The journal. Default: that of --config")
                    ->type_name("FILE"));
  cli->AddInput(
      command,
      command->add_option("--audit-log", request.audit_log, "The audit log. Default: that of --config")
          ->type_name("FILE"));
  cli->AddInput(command,
                command->add_option("--model", request.models, "A model file to go along; may be repeated")
                    ->type_name("FILE"));
  command
      ->add_option("--mesh", options->meshes,
                   "A mesh file to go along, NAME=FILE[,unit=..][,up=..][,scale=..]; may be repeated")
      ->type_name("MESH");
  *seed = command->add_option("--seed", options->seed, "Of the emulated rig or of the plan, if it had one")
              ->type_name("N");
  command->add_flag("--without-pictures", options->without_pictures, "Leave the photographs out");
  command->add_option("--hide", request.hide, "A further name to replace wherever it stands; may be repeated")
      ->type_name("NAME");
  cli->AddRigOptions(command);
}

}  // namespace touchstone::cli
