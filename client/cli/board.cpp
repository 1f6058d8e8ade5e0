#include "client/cli/board.h"

#include <filesystem>

#include "client/cli/model_output.h"
#include "client/report/report.h"
#include "client/report/words.h"
#include "server/base/status.h"
#include "server/base/text.h"
#include "server/diagnosis/boards/board_diagnosis.h"
#include "server/diagnosis/boards/board_pictures.h"
#include "server/diagnosis/report/from_boards.h"
#include "server/diagnosis/report/write_report.h"
#include "server/effects/all_effects.h"
#include "server/model/model.h"

namespace touchstone::cli {
namespace {

namespace boards = diagnosis::boards;

// What belongs to touches or needs more than a folder of pictures is refused rather than left aside.
absl::Status CheckBoardOptions(const Cli& cli, const ComparisonOptions& options, const BoardOptions& board) {
  if (board.square_mm == 0)
    return absl::InvalidArgumentError(
        "--board: how large is a square? Give --square-mm, for instance --square-mm 25");
  if (!options.html.empty())
    return absl::InvalidArgumentError(
        "--html: there is no page for pictures of a board; --json writes the report");
  if (!cli.source().servers.empty())
    return absl::InvalidArgumentError(
        "--server: pictures of a board are diagnosed by this program; leave --server out");
  if (!cli.source().meshes.empty() || !cli.source().mesh_folder.empty())
    return absl::InvalidArgumentError("--mesh, --mesh-dir: a board needs no mesh; leave them out");
  if (!options.also.empty())
    return absl::InvalidArgumentError(
        "--also: effects of your own take no part in the diagnosis of a board; leave it out");
  return absl::OkStatus();
}

absl::StatusOr<model::Model> NominalLensModel(const std::string& file) {
  if (file.empty()) return model::NominalModel();
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(file));
  return model::ParseModel(text, file, effects::Catalogue(), model::FilesBeside(file));
}

std::string VerdictWords(const v1::Report& report) {
  switch (report.verdict()) {
    case v1::Report::ADEQUATE:
      return "The lens is as good as these pictures can tell.";
    case v1::Report::MISSING_EFFECTS:
      return "The lens lacks effects; with them left-out pictures are predicted.";
    case v1::Report::UNEXPLAINED:
      return "The lens differs in a way that no effect of the catalogue describes.";
    case v1::Report::TOO_LITTLE_DATA:
      return "Too few pictures show the whole board.";
    default:
      return "";
  }
}

// The reprojection error after each step.
std::string LadderInWords(const v1::Report& report) {
  const v1::DataReport& data = client::MainData(report);
  if (!data.has_initial()) return "";
  std::string words = absl::StrFormat("\n%-22s %12s %12s %12s\n", "Reprojection error", "fitted px",
                                      "left-out px", "lack of fit");
  const auto add = [&](const std::string& name, const v1::Quality& quality) {
    absl::StrAppendFormat(&words, "%-22s %12.4f %12.4f   p = %.2g\n", name, quality.rmse(),
                          quality.heldout_rmse(), quality.lack_of_fit_p());
  };
  add("nominal lens", data.initial());
  for (int i = 0; i < data.after_step_size(); ++i)
    add(absl::StrCat("+ ", report.steps(i).effect()), data.after_step(i));
  if (data.noise_floor() > 0)
    absl::StrAppendFormat(&words,
                          "Noise of a corner: %.4f px a coordinate, at most (from residuals, no repeats)\n",
                          data.noise_floor());
  return words;
}

std::string BoardReportInWords(const v1::Report& report) {
  std::string words = absl::StrCat(VerdictWords(report), "\n\n", report.summary(), "\n");
  for (const v1::Step& step : report.steps()) {
    absl::StrAppend(&words, "\n", step.effect(), "  probability ",
                    absl::StrFormat("%.3f", step.probability()), "\n");
    for (const v1::ParameterValue& value : step.parameters())
      absl::StrAppendFormat(&words, "  %-10s %-2s %10.5g +- %.2g %s\n", value.name(), value.finger(),
                            value.value(), value.std_error(), value.unit());
    if (step.equivalent_size() > 0)
      absl::StrAppend(&words, "  these pictures cannot tell it from ", absl::StrJoin(step.equivalent(), ", "),
                      "\n");
  }
  absl::StrAppend(&words, LadderInWords(report));
  for (const std::string& warning : report.warnings()) absl::StrAppend(&words, "\nNote: ", warning, "\n");
  return words;
}

}  // namespace

void AddBoardOptions(CLI::App* command, BoardOptions* options) {
  command
      ->add_option(
          "--board", options->corners,
          "SET is a folder of PNG and JPEG pictures of a chessboard with so many inner corners, for instance "
          "9x6: what the lens differs from a pinhole by (camera.yaml in the folder, else a guess), with "
          "reprojection "
          "errors in px. Runs in this program and makes no page: without --server and --html")
      ->type_name("NxM")
      ->group("Board");
  command->add_option("--square-mm", options->square_mm, "Side of one square of the board")
      ->type_name("MM")
      ->group("Board");
}

absl::Status RunBoardDiagnosis(const Cli& cli, const ComparisonOptions& options, const BoardOptions& board,
                               const std::string& save_model) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckBoardOptions(cli, options, board));
  TOUCHSTONE_ASSIGN_OR_RETURN(const boards::BoardLayout layout,
                              boards::ParseBoardLayout(board.corners, board.square_mm));
  TOUCHSTONE_ASSIGN_OR_RETURN(const model::Model model, NominalLensModel(options.model));
  TOUCHSTONE_ASSIGN_OR_RETURN(const boards::BoardSet set, boards::ReadBoardPictures(options.set, layout));
  TOUCHSTONE_ASSIGN_OR_RETURN(const boards::BoardDiagnosis diagnosis,
                              boards::DiagnoseBoards(set, model, options.seed));
  v1::Report report = diagnosis::report::ToReport(diagnosis::report::FromBoards(diagnosis, set));
  AddClientProvenance(cli.command_line(), "", {}, &report);
  TOUCHSTONE_RETURN_IF_ERROR(WriteReportFiles(cli, options, report));
  if (!options.ReportOnStdout()) TOUCHSTONE_RETURN_IF_ERROR(cli.Print(BoardReportInWords(report)));
  if (save_model.empty()) return absl::OkStatus();
  model::Model improved = model;
  if (diagnosis.improved_model) {
    improved = *diagnosis.improved_model;
    improved.name = std::filesystem::path(save_model).stem().string();
  }
  TOUCHSTONE_RETURN_IF_ERROR(WriteModel(cli, "--save-model", save_model, improved));
  cli.LogWritten(save_model, absl::StrCat(" (hash ", improved.Hash().substr(0, 12), ")"));
  return absl::OkStatus();
}

}  // namespace touchstone::cli
