#include "client/cli/session/journal_session.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>

#include <filesystem>

#include "client/cli/common/output_file.h"
#include "client/cli/session/images.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/service/sessions/journalled_session.h"
#include "server/session/session_files.h"
#include "server/session/session_images.h"
#include "server/session/session_measurements.h"

namespace touchstone::cli {

constexpr char kExportOne[] = "touchstone session export FILE NAME";

bool IsJournalPath(const std::string& text) {
  return absl::EndsWith(text, ".db");
}

absl::StatusOr<std::unique_ptr<session::Journal>> OpenJournal(const std::string& path) {
  return session::Journal::Open(path, session::Journal::Mode::kReadOnly);
}

void AddSessionPlace(Cli* cli, CLI::App* command, SessionPlace* place, const std::string& what,
                     bool has_default) {
  cli->AddInput(command, command->add_option("NAME", place->name, what)->type_name("")->required());
  command
      ->add_option(
          "SESSION", place->in_journal,
          absl::StrCat("The session's name in that journal", has_default ? ". Default: its only one" : ""))
      ->type_name("");
}

absl::StatusOr<session::JournalSession> FindSession(const session::Journal& journal, const std::string& path,
                                                    const std::string& name, absl::string_view naming) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<session::JournalSession> sessions, journal.Sessions());
  std::vector<std::string> names;
  for (const session::JournalSession& session : sessions) {
    if (session.name == name || (name.empty() && sessions.size() == 1)) return session;
    names.push_back(session.name);
  }
  if (names.empty()) return absl::NotFoundError(absl::StrCat(path, ": the journal has no session"));
  if (!name.empty())
    return absl::NotFoundError(
        absl::StrCat(path, ": there is no session '", name, "'", DidYouMean(name, names)));
  std::string list;
  for (const std::string& known : names) absl::StrAppend(&list, list.empty() ? "" : ", ", known);
  if (!naming.empty())
    return absl::InvalidArgumentError(absl::StrCat(
        path, ": the journal has ", names.size(), " sessions (", list,
        "); say which: ", absl::StrReplaceAll(naming, {{"FILE", path}, {"NAME", names.front()}})));
  return absl::InvalidArgumentError(absl::StrCat(
      path, ": the journal has ", names.size(), " sessions (", list,
      "); write the one that is meant to a file: touchstone session export ", path, " ", names.front(),
      " -o ", std::filesystem::path(path).stem().string(), "_", names.front(), ".csv"));
}

absl::StatusOr<std::vector<client::MeasuredTouch>> TouchesOf(const session::Journal& journal,
                                                             const std::string& session) {
  return session::SessionMeasurements(journal, session);
}

absl::StatusOr<session::MeasurementSet> JournalSet(const std::string& path) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto journal, OpenJournal(path));
  TOUCHSTONE_ASSIGN_OR_RETURN(const session::JournalSession found, FindSession(*journal, path, "", ""));
  if (found.done == 0)
    return absl::FailedPreconditionError(
        absl::StrCat(path, ": session '", found.name, "' has no touch that is done"));
  return session::SessionMeasurementSet(*journal, found.name, path);
}

absl::StatusOr<std::optional<v1::ImageSetFiles>> JournalPhotographs(const Cli& cli, const std::string& path) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto journal, OpenJournal(path));
  TOUCHSTONE_ASSIGN_OR_RETURN(const session::JournalSession found, FindSession(*journal, path, "", ""));
  if (found.images == 0) return std::optional<v1::ImageSetFiles>();
  if (found.done > 0) {
    cli.Log(absl::StrCat(Counted(found.images, "photograph", "photographs"), " of session '", found.name,
                         "' are left out: touchstone session export ", path, " ", found.name,
                         " -o FOLDER writes the folder of touches and photographs together"));
    return std::optional<v1::ImageSetFiles>();
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(v1::ImageSetFiles files, session::SessionImageSetFiles(*journal, found.name));
  files.set_origin(path);
  return std::optional<v1::ImageSetFiles>(std::move(files));
}

namespace {

absl::StatusOr<std::string> CsvOf(const session::Journal& journal, const std::string& path,
                                  const std::string& session) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<client::MeasuredTouch> touches, TouchesOf(journal, session));
  if (touches.empty())
    return absl::FailedPreconditionError(
        absl::StrCat(path, ": session '", session, "' has no touch that is done"));
  return client::FormatMeasurements(touches);
}

}  // namespace

absl::StatusOr<std::string> JournalCsv(const std::string& path, const std::string& session) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto journal, OpenJournal(path));
  TOUCHSTONE_ASSIGN_OR_RETURN(const session::JournalSession found,
                              FindSession(*journal, path, session, kExportOne));
  return CsvOf(*journal, path, found.name);
}

absl::Status ExportFromJournal(const Cli& cli, const std::string& path, const std::string& session,
                               const std::string& output, session::Journal::SkipDamaged skip_damaged) {
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const auto journal,
      session::Journal::Open(path, session::Journal::Mode::kReadOnly, std::move(skip_damaged)));
  TOUCHSTONE_ASSIGN_OR_RETURN(const session::JournalSession found,
                              FindSession(*journal, path, session, kExportOne));
  if (absl::EndsWith(output, ".h5") || absl::EndsWith(output, ".hdf5"))
    return WriteOutputFileBy(output, cli.output().force, [&](const std::string& free_path) {
      return session::ExportSessionHdf5(*journal, found.name, free_path);
    });
  if (found.images == 0) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string csv, CsvOf(*journal, path, found.name));
    return WriteOutputFile(output, csv, cli.output().force);
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const service::JournalledSession made,
                              service::FilesOfJournal(*journal, found));
  if (!made.left_out.empty()) cli.Log(made.left_out);
  return WriteExportedSession(cli, found.name, made.files, output);
}

absl::StatusOr<size_t> ImportIntoJournal(const std::string& file_path, const std::string& journal_path,
                                         const std::string& session) {
  session::ImportOptions options;
  options.session = session;
  const bool hdf5 = absl::EndsWith(file_path, ".h5") || absl::EndsWith(file_path, ".hdf5");
  // The file first: one that is refused makes no journal.
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const session::SessionContent content,
      hdf5 ? session::ReadSessionHdf5(file_path, options) : session::ReadSessionCsv(file_path, options));
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const auto journal, session::Journal::Open(journal_path, session::Journal::Mode::kCreateOrReadWrite));
  TOUCHSTONE_RETURN_IF_ERROR(journal->AddSession(content));
  return content.touches.size();
}

}  // namespace touchstone::cli
