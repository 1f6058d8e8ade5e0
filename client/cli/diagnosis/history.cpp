// touchstone history: every session of a folder, one after another: how wrong the model was in each, and every value over the
// sessions with the limits that the others let expect.
#include <absl/strings/match.h>

#include <algorithm>
#include <filesystem>

#include "client/cli/common/output_file.h"
#include "client/cli/common/terminal.h"
#include "client/cli/diagnosis/comparison.h"
#include "client/report/report.h"
#include "server/base/status.h"
#include "server/session/measurements/measurement_set.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;

struct HistoryOptions : ComparisonOptions {
  std::string folder;
};

// The measurement files of the folder in the order of their names; files of another kind stay out, with a note.
absl::StatusOr<std::vector<std::string>> SessionsOf(const Cli& cli, const std::string& folder) {
  std::vector<std::string> paths, sessions;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string extension = entry.path().extension().string();
    if (extension == ".csv" || extension == ".db") paths.push_back(entry.path().string());
  }
  if (error)
    return absl::NotFoundError(absl::StrCat("DIR: '", folder, "': ", error.message(),
                                            "; a folder of measurement files was expected"));
  std::sort(paths.begin(), paths.end());
  for (const std::string& path : paths) {
    if (fs::path(path).extension() == ".csv") {
      const absl::StatusOr<session::MeasurementSet> set = session::ReadMeasurementSet(path);
      if (!set.ok() || set->fingers == 0) {
        cli.Log(absl::StrCat("note: left out: ", set.ok() ? absl::StrCat(path, " is a plan, without times")
                                                          : std::string(set.status().message())));
        continue;
      }
    }
    sessions.push_back(path);
  }
  if (sessions.size() < 2)
    return absl::InvalidArgumentError(
        absl::StrCat("DIR: ", folder, " holds ", sessions.size() == 1 ? "one session" : "no session",
                     " (measurement files *.csv, journals *.db); two or more were expected"));
  if (sessions.size() > static_cast<size_t>(kMaxSessions))
    return absl::InvalidArgumentError(absl::StrCat("DIR: ", folder, " holds ", sessions.size(),
                                                   " sessions; at most ", kMaxSessions,
                                                   " are compared at once: move the oldest elsewhere"));
  return sessions;
}

absl::StatusOr<v1::Report> DiagnoseAll(const Cli& cli, const HistoryOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto comparison, Comparison::Open(cli, options));
  v1::DiagnoseRequest request;
  return comparison->Run<v1::DiagnoseResponse>([&](grpc::ClientContext* context) {
    *request.mutable_evidence() = comparison->evidence();
    *request.mutable_further() = {comparison->further().begin(), comparison->further().end()};
    return comparison->connection().diagnosis().Diagnose(context, request);
  });
}

// The session that `refusal` names; false: it names none.
bool LeaveOut(const Cli& cli, const absl::Status& refusal, std::vector<std::string>* sessions) {
  const auto named = std::find_if(sessions->begin(), sessions->end(), [&](const std::string& path) {
    return absl::StartsWith(refusal.message(), path + ":");
  });
  if (named == sessions->end()) return false;
  cli.Log(absl::StrCat("note: left out: ", refusal.message()));
  sessions->erase(named);
  return true;
}

absl::Status RunHistory(const Cli& cli, HistoryOptions options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckNoMeshes(cli, {{"--html", options.html}, {"--json", options.json}}));
  TOUCHSTONE_ASSIGN_OR_RETURN(options.sets, SessionsOf(cli, options.folder));
  TOUCHSTONE_RETURN_IF_ERROR(CheckOutputFiles({{"--html", options.html}, {"--json", options.json}},
                                              options.sets, cli.output().force));
  absl::StatusOr<v1::Report> report = DiagnoseAll(cli, options);
  // A session whose object has no mesh stays out as files of another kind do.
  while (absl::IsNotFound(report.status()) && options.sets.size() > 2 &&
         LeaveOut(cli, report.status(), &options.sets))
    report = DiagnoseAll(cli, options);
  TOUCHSTONE_RETURN_IF_ERROR(report.status());
  TOUCHSTONE_RETURN_IF_ERROR(WriteReportFiles(cli, options, *report));
  if (options.ReportOnStdout()) return absl::OkStatus();
  return cli.Print(client::TerminalHistory(*report, TerminalWidth(), ColourOnStdout()));
}

}  // namespace

void AddHistory(Cli* cli) {
  auto options = std::make_shared<HistoryOptions>();
  options->takes_sets = false;
  options->max_sets = kMaxSessions;
  CLI::App* command = cli->AddCommand(
      nullptr, "history",
      "Watches a rig: every session of a folder in the order of the files' names, the model's error in each, "
      "and a control chart of every value, with the limits that the other sessions let expect.",
      "touchstone history sessions --model rig.yaml --mesh-dir meshes\n"
      "touchstone history sessions --model rig.yaml --mesh-dir meshes --html history.html",
      [cli, options] { return RunHistory(*cli, *options); });
  CLI::Option* folder =
      command
          ->add_option("DIR", options->folder,
                       "Folder of measurement files (*.csv) and journals (*.db), one session each")
          ->required();
  cli->AddInput(command, folder);
  AddComparisonOptions(cli, command, options.get(), /*html=*/true);
}

}  // namespace touchstone::cli
