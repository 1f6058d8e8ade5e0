// touchstone session create|list|show|export|import|fix|delete|restore: measured sets that a server keeps, or that
// a journal holds.
#include <absl/strings/str_join.h>

#include <cstdio>
#include <filesystem>

#include "client/cli/common/common.h"
#include "client/cli/common/interrupt.h"
#include "client/cli/common/output_file.h"
#include "client/cli/session/fix.h"
#include "client/cli/session/images.h"
#include "client/cli/session/journal_session.h"
#include "client/cli/session/listing.h"
#include "client/cli/session/trash.h"
#include "client/cli/session/verify.h"
#include "client/source/plans/touch_ids.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/session/images/image_set_file.h"
#include "server/session/images/image_set_hdf5.h"

namespace touchstone::cli {
namespace {

absl::Status RunCreate(const Cli& cli, const SessionOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, ConnectToServer(cli));
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::Session session,
                              SendSession(connection.get(), options.file, options.name, options.check));
  if (cli.output().json)
    PrintJson(SessionJson(session));
  else
    cli.Log(absl::StrCat(options.check ? "can be stored as " : "stored as ", options.name, ": ",
                         InWords(session)));
  return absl::OkStatus();
}

// A journal keeps what a rig saw, in the rig's frame and as its camera gave it; photographs with poses in an object's
// frame are kept by a server.
absl::Status ImportToServer(const Cli& cli, const SessionOptions& options) {
  SessionOptions create = options;
  if (create.name.empty())
    create.name = client::SessionNameOf(std::filesystem::path(options.file + "/").parent_path().string());
  TOUCHSTONE_RETURN_IF_ERROR(client::CheckSessionName(create.name, "--session"));
  return RunCreate(cli, create);
}

absl::Status RunImport(const Cli& cli, const SessionOptions& options) {
  std::error_code error;
  const bool folder = std::filesystem::is_directory(options.file, error);
  const bool image_set_file = !folder && IsHdf5Path(options.file) && session::IsImageSetHdf5(options.file);
  if (image_set_file && !options.output.empty() && !IsJournalPath(options.output)) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const service::StoredSession session, ReadImageSession(options.file));
    return WriteExportedSession(cli, options.file, session, options.output);
  }
  if (options.output.empty() && (folder || !cli.source().servers.empty()))
    return ImportToServer(cli, options);
  if (folder || image_set_file)
    return absl::InvalidArgumentError(
        absl::StrCat("-o: ", options.file,
                     " is an image set, whose poses are in the object's frame; a journal keeps them "
                     "in a rig's. A server keeps it: touchstone session import ",
                     options.file, " --server 127.0.0.1:50051"));
  if (options.output.empty())
    return absl::InvalidArgumentError(
        "say where to: -o SESSION.db puts the touches into a journal, --server ADDRESS has a server keep "
        "them");
  if (!IsJournalPath(options.output))
    return absl::InvalidArgumentError(
        absl::StrCat("-o: '", options.output, "' is no journal; its name ends in .db"));
  const std::string name = options.name.empty() ? client::SessionNameOf(options.file) : options.name;
  TOUCHSTONE_RETURN_IF_ERROR(client::CheckSessionName(name, "--session"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const size_t touches, ImportIntoJournal(options.file, options.output, name));
  if (cli.output().json) PrintJson({{"session", name}, {"journal", options.output}, {"touches", touches}});
  cli.Log(absl::StrCat(options.output, ": session '", name, "', ", Counted(touches, "touch", "touches")));
  return absl::OkStatus();
}

absl::Status ExportJournal(const Cli& cli, const SessionOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto journal, OpenJournal(options.name));
  SayIfUnchecked(cli, *journal, options.name);
  size_t damaged = 0;
  session::Journal::SkipDamaged skip;
  if (options.skip_damaged)
    skip = [&](const absl::Status& damage) {
      ++damaged;
      cli.Log(absl::StrCat("left out: ", damage.message()));
    };
  TOUCHSTONE_RETURN_IF_ERROR(
      ExportFromJournal(cli, options.name, options.in_journal, options.output, std::move(skip)));
  if (options.skip_damaged)
    cli.Log(damaged == 0 ? "nothing was damaged"
                         : "what was damaged is not in this export: see the lines above");
  return absl::OkStatus();
}

absl::Status RunExport(const Cli& cli, const SessionOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckInJournal(options.name, options.in_journal));
  if (IsJournalPath(options.name)) return ExportJournal(cli, options);
  // A folder of photographs as one file; nothing else is a name with a slash or a folder's.
  if (session::IsImageSetFolder(options.name) && IsHdf5Path(options.output)) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const service::StoredSession session, ReadImageSession(options.name));
    return WriteExportedSession(cli, options.name, session, options.output);
  }
  if (options.skip_damaged)
    return absl::InvalidArgumentError(
        "--skip-damaged is for a journal (.db): copy the rig's with sqlite3 rig.db '.backup copy.db', and "
        "export that");
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, ConnectToServer(cli));
  std::string left_out;
  TOUCHSTONE_ASSIGN_OR_RETURN(const service::StoredSession session,
                              FetchSession(connection.get(), options.name, &left_out));
  if (!left_out.empty()) cli.Log(left_out);
  return WriteExportedSession(cli, options.name, session, options.output);
}

}  // namespace

void AddSession(Cli* cli) {
  auto options = std::make_shared<SessionOptions>();
  CLI::App* group = cli->AddGroup(
      "session",
      "Measured sets: at a server, where its replicas and other people find them, or in a rig's journal.",
      "touchstone session create monday set.csv --server 127.0.0.1:50051\n"
      "touchstone session list --server 127.0.0.1:50051\n"
      "touchstone diagnose monday --model nominal.yaml --server 127.0.0.1:50051\n"
      "touchstone session export monday -o set.csv --server 127.0.0.1:50051\n"
      "touchstone session list session.db                                        a journal of "
      "touchstone rig run\n"
      "touchstone session export session.db -o set.csv");
  const auto add_name = [&](CLI::App* command) {
    command->add_option("NAME", options->name, "The session's name: letters, digits, '_', '-' and '.'")
        ->type_name("")
        ->required();
  };
  const auto add_place = [&](CLI::App* command) {
    AddSessionPlace(cli, command, options.get(),
                    "The name of a server's session, a journal (.db), or for export to .h5 the folder of an "
                    "image set",
                    /*has_default=*/true);
  };
  const std::string server = " --server 127.0.0.1:50051";

  CLI::App* create = cli->AddCommand(
      group, "create",
      "Checks a measurement file, or a folder of photographs (images.csv, "
      "camera.yaml, pictures, and touches.csv if there is one), and stores it. A session never "
      "changes.",
      "touchstone session create monday set.csv" + server + "\n" +
          "touchstone session create pictures photos" + server + "\n" +
          "touchstone session create monday set.csv --check" + server,
      [cli, options] { return RunCreate(*cli, *options); });
  add_name(create);
  create->add_option("FILE", options->file, "The measurement file (CSV), or the folder")
      ->type_name("")
      ->required();
  create->add_flag("--check", options->check, "Only check it");
  cli->AddSourceOptions(create);

  CLI::App* list =
      cli->AddCommand(group, "list", "Lists the stored sessions.",
                      "touchstone session list" + server + "\ntouchstone session list session.db\n" +
                          "touchstone session list session.db --deleted",
                      [cli, options] { return RunList(*cli, *options); });
  list->add_option("JOURNAL", options->file, "A journal (.db). Default: those of --server")->type_name("");
  list->add_flag("--deleted", options->deleted, "Those in the trash of a rig or of a journal");
  cli->AddSourceOptions(list);

  CLI::App* show = cli->AddCommand(
      group, "show", "Describes a session.",
      "touchstone session show monday" + server + "\ntouchstone session show session.db monday",
      [cli, options] { return RunShow(*cli, *options); });
  add_place(show);
  cli->AddSourceOptions(show);

  CLI::App* out = cli->AddCommand(group, "export",
                                  "Writes a session's measurement file, or the folder of its photographs, as "
                                  "it was stored.",
                                  "touchstone session export monday -o set.csv" + server + "\n" +
                                      "touchstone session export pictures -o photos" + server + "\n" +
                                      "touchstone session export session.db -o set.csv\n"
                                      "touchstone session export session.db monday -o set.h5\n"
                                      "touchstone session export session.db -o photos\n"
                                      "touchstone session export photos -o photos.h5",
                                  [cli, options] { return RunExport(*cli, *options); });
  add_place(out);
  cli->AddOutput(out, "-o,--output", &options->output,
                 "The file to write, or the folder for photographs; .h5: photographs with poses and lens as "
                 "one file, or all "
                 "that a journal has. Default: stdout");
  out->add_flag(
      "--skip-damaged", options->skip_damaged,
      "Leave out touches and pictures of a journal that differ from their checksums, naming each; else one "
      "of them is an error");
  cli->AddSourceOptions(out);

  CLI::App* in =
      cli->AddCommand(group, "import",
                      "Puts a measurement file into a journal, or has a server keep it or a folder "
                      "of photographs (with its touches.csv, if there is one).",
                      "touchstone session import set.csv -o session.db\n"
                      "touchstone session import photos" +
                          server + "\n" + "touchstone session import set.csv -o session.db --session monday",
                      [cli, options] { return RunImport(*cli, *options); });
  cli->AddInput(in,
                in->add_option("FILE", options->file,
                               "The measurement file (.csv), what session export wrote (.h5), or the folder "
                               "of an image set; of one as .h5, -o FOLDER makes the folder again")
                    ->type_name("")
                    ->required());
  cli->AddOutput(in, "-o,--output", &options->output,
                 "The journal (.db); made if it is not there, else the session is added to what it has",
                 OutputKind::kJournal);
  cli->AddSourceOptions(in);
  in->add_option("--session", options->name, "The session's name. Default: the file's without its ending")
      ->type_name("NAME");

  AddSessionVerify(cli, group);

  AddSessionFix(cli, group);

  AddSessionTrash(cli, group);
}

}  // namespace touchstone::cli
