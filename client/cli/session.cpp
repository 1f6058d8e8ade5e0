// touchstone session create|list|show|export|delete: measured sets that a server keeps.
#include <absl/strings/str_join.h>

#include <cstdio>
#include <filesystem>
#include <fstream>

#include "client/cli/common.h"
#include "client/cli/interrupt.h"
#include "server/base/status.h"
#include "server/base/text.h"

namespace touchstone::cli {
namespace {

constexpr size_t kPiece = 1 << 20;

struct Options {
  std::string name, file, output;
  bool check = false;
};

absl::StatusOr<std::unique_ptr<client::Connection>> ConnectToServer(const Cli& cli) {
  if (cli.source().servers.empty())
    return absl::InvalidArgumentError(
        "--server is missing: sessions are kept by a touchstone-server, for instance --server "
        "127.0.0.1:50051");
  return cli.Connect();
}

Json SessionJson(const v1::Session& session) {
  return {{"name", session.name()},
          {"hash", session.hash()},
          {"bytes", session.bytes()},
          {"touches", session.touches()},
          {"fingers", session.fingers()},
          {"objects", std::vector<std::string>(session.objects().begin(), session.objects().end())},
          {"has_poses", session.has_poses()}};
}

std::string InWords(const v1::Session& session) {
  return absl::StrCat(Counted(session.touches(), "touch", "touches"), ", ",
                      Counted(session.fingers(), "finger", "fingers"), ", ",
                      session.has_poses() ? "" : "no poses, ", "hash ", session.hash().substr(0, 12));
}

absl::Status RunCreate(const Cli& cli, const Options& options) {
  std::ifstream file(options.file, std::ios::binary);
  std::error_code error;
  if (!file || !std::filesystem::is_regular_file(options.file, error))
    return absl::NotFoundError(
        absl::StrCat(options.file, ": cannot be read; a measurement file was expected"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, ConnectToServer(cli));
  grpc::ClientContext context;
  const Interrupt::Handler handler([&context] { context.TryCancel(); });
  v1::Session session;
  const auto writer = connection->sessions().CreateSession(&context, &session);
  v1::CreateSessionRequest request;
  request.set_name(options.name);
  request.set_validate_only(options.check);
  std::string piece(kPiece, '\0');
  do {
    file.read(piece.data(), kPiece);
    request.set_csv(piece.substr(0, file.gcount()));
    if (!writer->Write(request)) break;
    request.clear_name();
  } while (file);
  writer->WritesDone();
  TOUCHSTONE_RETURN_IF_ERROR(client::FromGrpc(writer->Finish()));
  if (cli.output().json)
    PrintJson(SessionJson(session));
  else
    cli.Log(absl::StrCat(options.check ? "can be stored as " : "stored as ", options.name, ": ",
                         InWords(session)));
  return absl::OkStatus();
}

absl::Status RunList(const Cli& cli) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, ConnectToServer(cli));
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::ListSessionsResponse response,
                              client::Connection::Call(&v1::Sessions::Stub::ListSessions,
                                                       connection->sessions(), v1::ListSessionsRequest()));
  if (cli.output().json) {
    Json list = Json::array();
    for (const v1::Session& session : response.sessions()) list.push_back(SessionJson(session));
    PrintJson({{"sessions", list}});
    return absl::OkStatus();
  }
  if (response.sessions().empty()) {
    cli.Log("The server keeps no session; touchstone session create NAME FILE stores one.");
    return absl::OkStatus();
  }
  Table table({"SESSION", "TOUCHES", "FINGERS", "POSES", "HASH", "OBJECTS"});
  for (const v1::Session& session : response.sessions())
    table.Add({session.name(), std::to_string(session.touches()), std::to_string(session.fingers()),
               session.has_poses() ? "yes" : "no", session.hash().substr(0, 12),
               absl::StrJoin(session.objects(), ", ")});
  return WriteOutput("", table.Text());
}

absl::Status RunShow(const Cli& cli, const Options& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, ConnectToServer(cli));
  v1::GetSessionRequest request;
  request.set_name(options.name);
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const v1::Session session,
      client::Connection::Call(&v1::Sessions::Stub::GetSession, connection->sessions(), request));
  if (cli.output().json) {
    PrintJson(SessionJson(session));
    return absl::OkStatus();
  }
  return WriteOutput("", absl::StrCat(session.name(), ": ", InWords(session), "\n  Objects   ",
                                      absl::StrJoin(session.objects(), ", "), "\n  Size      ",
                                      session.bytes(), " bytes\n"));
}

absl::Status RunExport(const Cli& cli, const Options& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, ConnectToServer(cli));
  grpc::ClientContext context;
  const Interrupt::Handler handler([&context] { context.TryCancel(); });
  v1::ExportSessionRequest request;
  request.set_name(options.name);
  const auto reader = connection->sessions().ExportSession(&context, request);
  v1::ExportSessionResponse response;
  std::string csv;
  while (reader->Read(&response)) csv += response.csv();
  TOUCHSTONE_RETURN_IF_ERROR(client::FromGrpc(reader->Finish()));
  return WriteOutput(options.output, csv);
}

absl::Status RunDelete(const Cli& cli, const Options& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, ConnectToServer(cli));
  v1::DeleteSessionRequest request;
  request.set_name(options.name);
  TOUCHSTONE_RETURN_IF_ERROR(
      client::Connection::Call(&v1::Sessions::Stub::DeleteSession, connection->sessions(), request).status());
  cli.Log("deleted " + options.name);
  return absl::OkStatus();
}

}  // namespace

void AddSession(Cli* cli) {
  auto options = std::make_shared<Options>();
  CLI::App* group = cli->AddGroup(
      "session", "Stores measured sets at a server, where its replicas and other people find them.",
      "touchstone session create monday set.csv --server 127.0.0.1:50051\n"
      "touchstone session list --server 127.0.0.1:50051\n"
      "touchstone diagnose monday --model nominal.yaml --server 127.0.0.1:50051\n"
      "touchstone session export monday -o set.csv --server 127.0.0.1:50051");
  const auto add_name = [&](CLI::App* command) {
    command->add_option("NAME", options->name, "The session's name: letters, digits, '_', '-' and '.'")
        ->type_name("")
        ->required();
  };
  const std::string server = " --server 127.0.0.1:50051";

  CLI::App* create =
      cli->AddCommand(group, "create", "Checks a measurement file and stores it. A session never changes.",
                      "touchstone session create monday set.csv" + server + "\n" +
                          "touchstone session create monday set.csv --check" + server,
                      [cli, options] { return RunCreate(*cli, *options); });
  add_name(create);
  create->add_option("FILE", options->file, "The measurement file (CSV)")->type_name("")->required();
  create->add_flag("--check", options->check, "Only check it");
  cli->AddSourceOptions(create);

  CLI::App* list = cli->AddCommand(group, "list", "Lists the stored sessions.",
                                   "touchstone session list" + server, [cli] { return RunList(*cli); });
  cli->AddSourceOptions(list);

  CLI::App* show =
      cli->AddCommand(group, "show", "Describes a session.", "touchstone session show monday" + server,
                      [cli, options] { return RunShow(*cli, *options); });
  add_name(show);
  cli->AddSourceOptions(show);

  CLI::App* out = cli->AddCommand(group, "export", "Writes a session's measurement file, as it was stored.",
                                  "touchstone session export monday -o set.csv" + server,
                                  [cli, options] { return RunExport(*cli, *options); });
  add_name(out);
  out->add_option("-o,--output", options->output, "The file to write. Default: stdout")->type_name("FILE");
  cli->AddSourceOptions(out);

  CLI::App* remove =
      cli->AddCommand(group, "delete", "Deletes a session.", "touchstone session delete monday" + server,
                      [cli, options] { return RunDelete(*cli, *options); });
  add_name(remove);
  cli->AddSourceOptions(remove);
}

}  // namespace touchstone::cli
