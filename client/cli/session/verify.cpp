#include "client/cli/session/verify.h"

#include <absl/strings/str_join.h>

#include "client/cli/common/interrupt.h"
#include "client/cli/common/progress_bar.h"
#include "client/cli/session/images.h"
#include "client/cli/session/journal_session.h"
#include "client/cli/session/trash.h"
#include "server/base/status.h"

namespace touchstone::cli {
namespace {

constexpr size_t kMaxDamagesShown = 5;  // of what is damaged

using VerifyOptions = SessionPlace;

// What reading the whole session found.
struct Found {
  std::string name;
  uint64_t touches = 0, done = 0, images = 0;
  bool checksums = true;
  std::vector<std::string> damaged;  // in words
};

absl::StatusOr<Found> ReadJournal(const Cli& cli, const VerifyOptions& options) {
  Found found;
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto journal,
                              session::Journal::Open(options.name, session::Journal::Mode::kReadOnly,
                                                     [&](const absl::Status& damage) {
                                                       found.damaged.emplace_back(damage.message());
                                                     }));
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const session::JournalSession session,
      FindSession(*journal, options.name, options.in_journal, "touchstone session verify FILE NAME"));
  found.name = session.name;
  found.checksums = journal->has_checksums();
  ProgressBar bar(!cli.output().quiet);
  const auto show = [&] {
    const uint64_t read = found.touches + found.images;
    bar.Show(read, session.touches + session.images, read, "touches and pictures");
  };
  std::vector<std::string> ids;
  TOUCHSTONE_RETURN_IF_ERROR(journal->ForEachTouch(session.name, [&](const session::JournalTouch& touch) {
    ids.push_back(touch.id);
    ++found.touches;
    found.done += touch.stage == session::TouchStage::kDone;
    show();
    return !Interrupt::Raised();
  }));
  for (const std::string& id : ids) {
    const auto series = journal->Series(session.name, id);
    if (!series.ok()) found.damaged.emplace_back(series.status().message());
  }
  TOUCHSTONE_RETURN_IF_ERROR(journal->ForEachImage(session.name, [&](const session::JournalImage&) {
    ++found.images;
    show();
    return !Interrupt::Raised();
  }));
  if (Interrupt::Raised()) return absl::CancelledError("interrupted");
  return found;
}

// What the server sends must have the hash that the server has noted.
absl::StatusOr<Found> ReadStored(const Cli& cli, const VerifyOptions& options) {
  if (cli.source().servers.empty())
    return absl::InvalidArgumentError(absl::StrCat(
        "NAME: '", options.name,
        "' is no journal (.db), and no server is named; --server 127.0.0.1:50051, or TOUCHSTONE_SERVER, says "
        "whose session it is. Files and folders: touchstone verify ",
        options.name));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, cli.Connect());
  v1::GetSessionRequest request;
  request.set_name(options.name);
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::Session noted,
                              connection->Call(&v1::Sessions::Stub::GetSession, request));
  std::string left_out;
  TOUCHSTONE_ASSIGN_OR_RETURN(const service::StoredSession stored,
                              FetchSession(connection.get(), options.name, &left_out));
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const v1::Session read,
      service::DescribeSession(options.name, service::PackSession(stored), options.name));
  Found found{options.name, read.touches(), read.touches(), read.images(), true, {}};
  if (read.hash() != noted.hash())
    found.damaged.push_back(absl::StrCat("what was sent has the hash ", read.hash().substr(0, 12),
                                         "; the server noted ", noted.hash().substr(0, 12)));
  if (!left_out.empty()) found.damaged.push_back(left_out);
  return found;
}

std::string Shown(const std::vector<std::string>& damaged) {
  const std::vector<std::string> first(damaged.begin(),
                                       damaged.begin() + std::min(damaged.size(), kMaxDamagesShown));
  return absl::StrCat(absl::StrJoin(first, "; "),
                      damaged.size() > kMaxDamagesShown
                          ? absl::StrCat("; and ", damaged.size() - kMaxDamagesShown, " more")
                          : "");
}

absl::Status RunVerify(const Cli& cli, const VerifyOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckInJournal(options.name, options.in_journal));
  const bool journal = IsJournalPath(options.name);
  TOUCHSTONE_ASSIGN_OR_RETURN(const Found found,
                              journal ? ReadJournal(cli, options) : ReadStored(cli, options));
  if (cli.output().json)
    PrintJson({{"session", found.name},
               {"whole", found.damaged.empty()},
               {"checksums", found.checksums},
               {"touches", found.touches},
               {"done", found.done},
               {"images", found.images},
               {"damaged", found.damaged}});
  const std::string read =
      absl::StrCat(Counted(found.touches, "touch", "touches"),
                   found.done < found.touches ? absl::StrCat(" (", found.done, " of them done)") : "", ", ",
                   Counted(found.images, "picture", "pictures"));
  if (!found.damaged.empty())
    return absl::DataLossError(absl::StrCat(
        "session '", found.name, "' is not whole: ", read, " can be read; ", Shown(found.damaged),
        journal ? absl::StrCat(". touchstone recover ", options.name, " -o saved.csv saves the others")
                : ""));
  cli.Log(absl::StrCat(
      "session '", found.name, "' is whole: ", read,
      found.checksums ? "" : "; a journal of version 1 has no checksums, so changed numbers do not show"));
  return absl::OkStatus();
}

}  // namespace

void AddSessionVerify(Cli* cli, CLI::App* group) {
  auto options = std::make_shared<VerifyOptions>();
  CLI::App* command = cli->AddCommand(
      group, "verify",
      "Reads a whole session, of a server or of a journal, and says whether it is as it was stored: by "
      "checksums, picture by picture. Exit code 4 if not. Nothing is written.",
      "touchstone session verify monday --server 127.0.0.1:50051\n"
      "touchstone session verify session.db\n"
      "touchstone session verify rig.db monday",
      [cli, options] { return RunVerify(*cli, *options); });
  AddSessionPlace(cli, command, options.get(), "The name of a server's session, or a journal (.db)",
                  /*has_default=*/true);
  cli->AddSourceOptions(command);
}

}  // namespace touchstone::cli
