#include "client/cli/session/listing.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "client/cli/session/trash.h"
#include "server/base/status.h"
#include "server/base/units.h"

namespace touchstone::cli {
namespace {

Json JournalSessionJson(const session::JournalSession& session) {
  return {{"name", session.name},
          {"source", session.provenance},
          {"created_unix_s", session.created_unix_s},
          {"fingers", session.fingers},
          {"spacing_mm", session.spacing_m * kMillimetresPerMetre},
          {"touches", session.touches},
          {"done", session.done},
          {"failed", session.failed},
          {"images", session.images},
          {"deleted_unix_s", session.deleted_unix_s},
          {"deleted_by", session.deleted_by},
          {"objects", session.objects}};
}

std::string DeletedText(double unix_s, const std::string& by) {
  return absl::StrCat(UtcText(unix_s), by.empty() ? "" : " by ", by);
}

absl::Status ListJournal(const Cli& cli, const std::string& path, bool deleted) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto journal, OpenJournal(path));
  SayIfUnchecked(cli, *journal, path);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<session::JournalSession> sessions,
                              deleted ? journal->DeletedSessions() : journal->Sessions());
  if (cli.output().json) {
    Json list = Json::array();
    for (const session::JournalSession& session : sessions) list.push_back(JournalSessionJson(session));
    PrintJson({{"sessions", list}});
    return absl::OkStatus();
  }
  Table table({"SESSION", "TOUCHES", "DONE", "PICTURES", deleted ? "DELETED" : "CREATED", "OBJECTS"});
  for (const session::JournalSession& session : sessions)
    table.Add(
        {session.name, std::to_string(session.touches), std::to_string(session.done),
         std::to_string(session.images),
         deleted ? DeletedText(session.deleted_unix_s, session.deleted_by) : UtcText(session.created_unix_s),
         absl::StrJoin(session.objects, ", ")});
  return cli.Print(table.Text());
}

absl::Status ShowJournal(const Cli& cli, const SessionOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto journal, OpenJournal(options.name));
  SayIfUnchecked(cli, *journal, options.name);
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const session::JournalSession session,
      FindSession(*journal, options.name, options.in_journal, "touchstone session show FILE NAME"));
  if (cli.output().json) {
    PrintJson(JournalSessionJson(session));
    return absl::OkStatus();
  }
  return cli.Print(absl::StrCat(
      session.name, ": ", Counted(session.touches, "touch", "touches"), ", ", session.done, " done, ",
      session.failed, " failed, ", Counted(session.images, "picture", "pictures"), ", ",
      Counted(session.fingers, "finger", "fingers"), "\n  Objects   ", absl::StrJoin(session.objects, ", "),
      "\n  Source    ", session.provenance, "\n  Created   ", UtcText(session.created_unix_s), "\n"));
}

// All of them, however many pages they take.
absl::StatusOr<std::vector<v1::Session>> ListSessions(client::Connection* connection, bool deleted) {
  std::vector<v1::Session> sessions;
  v1::ListSessionsRequest request;
  request.set_deleted(deleted);
  do {
    TOUCHSTONE_ASSIGN_OR_RETURN(v1::ListSessionsResponse page,
                                connection->Call(&v1::Sessions::Stub::ListSessions, request));
    for (v1::Session& session : *page.mutable_sessions()) sessions.push_back(std::move(session));
    request.set_page_token(page.next_page_token());
  } while (!request.page_token().empty());
  return sessions;
}

}  // namespace

absl::StatusOr<std::unique_ptr<client::Connection>> ConnectToServer(const Cli& cli) {
  if (cli.source().servers.empty())
    return absl::InvalidArgumentError(
        "--server is missing: sessions are kept by a touchstone-server, for instance --server "
        "127.0.0.1:50051, or by a journal, for instance session.db");
  return cli.Connect();
}

Json SessionJson(const v1::Session& session) {
  return {{"name", session.name()},
          {"hash", session.hash()},
          {"bytes", session.bytes()},
          {"touches", session.touches()},
          {"fingers", session.fingers()},
          {"objects", std::vector<std::string>(session.objects().begin(), session.objects().end())},
          {"has_poses", session.has_poses()},
          {"images", session.images()}};
}

std::string InWords(const v1::Session& session) {
  std::vector<std::string> parts;
  if (session.touches() > 0 || session.images() == 0) {
    parts.push_back(Counted(session.touches(), "touch", "touches"));
    parts.push_back(Counted(session.fingers(), "finger", "fingers"));
    if (!session.has_poses()) parts.push_back("no poses");
  }
  if (session.images() > 0) parts.push_back(Counted(session.images(), "photograph", "photographs"));
  parts.push_back(absl::StrCat("hash ", session.hash().substr(0, 12)));
  return absl::StrJoin(parts, ", ");
}

void SayIfUnchecked(const Cli& cli, const session::Journal& journal, const std::string& path) {
  if (!journal.has_checksums())
    cli.Log(absl::StrCat(path,
                         " is of version 1, whose rows have no checksums: damage to its numbers would not be "
                         "noticed (opened for writing, it gets them)"));
}

absl::Status RunList(const Cli& cli, const SessionOptions& options) {
  if (!options.file.empty()) {
    if (IsJournalPath(options.file)) return ListJournal(cli, options.file, options.deleted);
    return absl::InvalidArgumentError(
        absl::StrCat("'", options.file, "' is no journal; its name ends in .db"));
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, ConnectToServer(cli));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<v1::Session> sessions,
                              ListSessions(connection.get(), options.deleted));
  if (cli.output().json) {
    Json list = Json::array();
    for (const v1::Session& session : sessions) list.push_back(SessionJson(session));
    PrintJson({{"sessions", list}});
    return absl::OkStatus();
  }
  if (sessions.empty()) {
    cli.Log(options.deleted
                ? "Nothing is in the trash; what a server deletes is gone, rigs and journals have one."
                : "The server keeps no session; touchstone session create NAME FILE stores one.");
    return absl::OkStatus();
  }
  if (options.deleted) {
    Table table({"SESSION", "TOUCHES", "DELETED", "OBJECTS"});
    for (const v1::Session& session : sessions)
      table.Add({session.name(), std::to_string(session.touches()),
                 DeletedText(session.deleted_unix_s(), session.deleted_by()),
                 absl::StrJoin(session.objects(), ", ")});
    return cli.Print(table.Text());
  }
  Table table({"SESSION", "TOUCHES", "FINGERS", "POSES", "PICTURES", "HASH", "OBJECTS"});
  for (const v1::Session& session : sessions)
    table.Add({session.name(), std::to_string(session.touches()), std::to_string(session.fingers()),
               session.has_poses() ? "yes" : "no", std::to_string(session.images()),
               session.hash().empty() ? "-" : session.hash().substr(0, 12),
               absl::StrJoin(session.objects(), ", ")});
  return cli.Print(table.Text());
}

absl::Status RunShow(const Cli& cli, const SessionOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckInJournal(options.name, options.in_journal));
  if (IsJournalPath(options.name)) return ShowJournal(cli, options);
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, ConnectToServer(cli));
  v1::GetSessionRequest request;
  request.set_name(options.name);
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::Session session,
                              connection->Call(&v1::Sessions::Stub::GetSession, request));
  if (cli.output().json) {
    PrintJson(SessionJson(session));
    return absl::OkStatus();
  }
  return cli.Print(absl::StrCat(session.name(), ": ", InWords(session), "\n  Objects   ",
                                absl::StrJoin(session.objects(), ", "), "\n  Size      ", session.bytes(),
                                " bytes\n"));
}

}  // namespace touchstone::cli
