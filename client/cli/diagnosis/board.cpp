#include "client/cli/diagnosis/board.h"

#include "client/cli/options/model_output.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/diagnosis/boards/board_diagnosis.h"
#include "server/diagnosis/boards/board_pictures.h"
#include "server/diagnosis/report/kinds/from_boards.h"
#include "server/diagnosis/report/message/write_report.h"
#include "server/effects/all_effects.h"
#include "server/model/model.h"
#include "server/session/images/camera_yaml.h"

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
  if (!cli.source().servers.empty() && !cli.source().servers_from_environment)
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

absl::Status SaveCamera(const Cli& cli, const std::string& file, const boards::BoardDiagnosis& diagnosis) {
  if (!diagnosis.lens) {
    cli.Log("--save-camera: these pictures give no lens; no file is written");
    return absl::OkStatus();
  }
  TOUCHSTONE_RETURN_IF_ERROR(cli.Write(file, session::FormatCameraYaml(diagnosis.lens->camera)));
  cli.LogWritten(file, " (camera.yaml of the lens with all steps)");
  return absl::OkStatus();
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
  TOUCHSTONE_ASSIGN_OR_RETURN(const model::Model model, NominalLensModel(options.model()));
  TOUCHSTONE_ASSIGN_OR_RETURN(const boards::BoardSet set, boards::ReadBoardPictures(options.set(), layout));
  TOUCHSTONE_ASSIGN_OR_RETURN(const boards::BoardDiagnosis diagnosis,
                              boards::DiagnoseBoards(set, model, options.seed));
  v1::Report report = diagnosis::report::ToReport(diagnosis::report::FromBoards(diagnosis, set));
  AddClientProvenance(cli.command_line(), "", {}, &report);
  TOUCHSTONE_RETURN_IF_ERROR(PrintReport(cli, options, report));
  if (!board.save_camera.empty()) TOUCHSTONE_RETURN_IF_ERROR(SaveCamera(cli, board.save_camera, diagnosis));
  if (save_model.empty()) return absl::OkStatus();
  const std::string& improved = report.improved_model_yaml();
  TOUCHSTONE_ASSIGN_OR_RETURN(const model::Model written,
                              WriteModelText(cli, "--save-model", save_model,
                                             improved.empty() ? model::FormatModel(model) : improved));
  cli.LogWritten(save_model, absl::StrCat(" (hash ", written.Hash().substr(0, 12), ")"));
  return absl::OkStatus();
}

}  // namespace touchstone::cli
