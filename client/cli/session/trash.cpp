// touchstone session delete|restore: to the trash and back. A rig's sessions need its lease; a touchstone-server has no
// trash.
#include "client/cli/session/trash.h"

#include "client/cli/options/motion_options.h"
#include "client/cli/session/journal_session.h"
#include "client/source/connection/lease_keeper.h"
#include "server/base/status.h"

namespace touchstone::cli {
namespace {

struct TrashOptions : SessionPlace {
  bool purge = false;
  MotionFlags lease;
};

// The server that keeps the session, and its lease where it needs one.
struct LeasedServer {
  std::unique_ptr<client::Connection> connection;
  std::unique_ptr<client::LeaseKeeper> lease;
};

absl::StatusOr<LeasedServer> ConnectWithLease(const Cli& cli, const TrashOptions& options) {
  if (cli.source().servers.empty())
    return absl::InvalidArgumentError(
        "--server is missing: sessions are kept by a touchstone-server or a touchstone-gateway, for instance "
        "--server "
        "127.0.0.1:50051, or by a journal, for instance session.db");
  LeasedServer server;
  TOUCHSTONE_ASSIGN_OR_RETURN(server.connection, cli.Connect());
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::DescribeResponse source,
                              server.connection->Call(&v1::Source::Stub::Describe, v1::DescribeRequest()));
  client::LeaseOptions lease;
  lease.take = options.lease.take_lease;
  TOUCHSTONE_ASSIGN_OR_RETURN(
      server.lease, client::LeaseKeeper::Acquire(server.connection.get(), source, std::move(lease)));
  return server;
}

// What is done to a session, for people.
std::string Deleted(const TrashOptions& options, const std::string& name, bool has_trash) {
  if (options.purge) return absl::StrCat("purged ", name, " from the trash, for good");
  if (!has_trash) return "deleted " + name;
  return absl::StrCat("moved ", name, " to the trash; touchstone session restore takes it back");
}

absl::StatusOr<std::unique_ptr<session::Journal>> JournalToChange(const TrashOptions& options,
                                                                  const char* verb) {
  if (options.in_journal.empty())
    return absl::InvalidArgumentError(absl::StrCat(options.name, ": which session? touchstone session ", verb,
                                                   " ", options.name, " SESSION (touchstone session list ",
                                                   options.name, " lists them)"));
  return session::Journal::Open(options.name, session::Journal::Mode::kReadWrite);
}

absl::Status RunDelete(const Cli& cli, const TrashOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckInJournal(options.name, options.in_journal));
  if (IsJournalPath(options.name)) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto journal, JournalToChange(options, "delete"));
    TOUCHSTONE_RETURN_IF_ERROR(options.purge
                                   ? journal->PurgeSession(options.in_journal)
                                   : journal->DeleteSession(options.in_journal, client::LeaseHolder()));
    cli.Log(Deleted(options, options.in_journal, true));
    return absl::OkStatus();
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const LeasedServer server, ConnectWithLease(cli, options));
  if (options.purge && !server.lease->required())
    return absl::InvalidArgumentError(
        "--purge: a touchstone-server has no trash; without --purge it deletes at once");
  v1::DeleteSessionRequest request;
  request.set_name(options.name);
  request.set_lease_token(server.lease->token());
  request.set_purge(options.purge);
  TOUCHSTONE_RETURN_IF_ERROR(
      server.connection->CallOnce(&v1::Sessions::Stub::DeleteSession, request).status());
  cli.Log(Deleted(options, options.name, server.lease->required()));
  return absl::OkStatus();
}

absl::Status RunRestore(const Cli& cli, const TrashOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckInJournal(options.name, options.in_journal));
  std::string restored = options.name;
  if (IsJournalPath(options.name)) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto journal, JournalToChange(options, "restore"));
    TOUCHSTONE_RETURN_IF_ERROR(journal->RestoreSession(options.in_journal));
    restored = options.in_journal;
  } else {
    TOUCHSTONE_ASSIGN_OR_RETURN(const LeasedServer server, ConnectWithLease(cli, options));
    v1::RestoreSessionRequest request;
    request.set_name(options.name);
    request.set_lease_token(server.lease->token());
    TOUCHSTONE_RETURN_IF_ERROR(
        server.connection->CallOnce(&v1::Sessions::Stub::RestoreSession, request).status());
  }
  cli.Log(absl::StrCat("restored ", restored));
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckInJournal(const std::string& name, const std::string& in_journal) {
  if (in_journal.empty() || IsJournalPath(name)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("'", in_journal, "' is one argument too many: '", name,
                                                 "' is no journal (.db), but a server's session"));
}

void AddSessionTrash(Cli* cli, CLI::App* group) {
  auto options = std::make_shared<TrashOptions>();
  const std::string server = " --server 127.0.0.1:50051";
  const auto add_arguments = [&](CLI::App* command) {
    AddSessionPlace(cli, command, options.get(), "The name of a server's session, or a journal (.db)",
                    /*has_default=*/false);
    AddMotionOptions(command, &options->lease, false);
    cli->AddSourceOptions(command);
  };

  CLI::App* remove = cli->AddCommand(
      group, "delete",
      "Moves a session of a rig or of a journal to its trash; a touchstone-server deletes it at once.",
      "touchstone session delete monday" + server + "\ntouchstone session delete session.db monday\n" +
          "touchstone session delete session.db monday --purge",
      [cli, options] { return RunDelete(*cli, *options); });
  remove->add_flag("--purge", options->purge,
                   "End every session of this name that is in the trash, for good; the others stay");
  add_arguments(remove);

  CLI::App* restore = cli->AddCommand(
      group, "restore", "Takes the session that was deleted last under this name out of the trash.",
      "touchstone session restore monday --server 127.0.0.1:50052\n"
      "touchstone session restore session.db monday",
      [cli, options] { return RunRestore(*cli, *options); });
  add_arguments(restore);
}

}  // namespace touchstone::cli
