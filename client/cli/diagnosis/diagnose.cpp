// touchstone diagnose: how wrong a model is, where, why, what to add, and what the error becomes.
#include <absl/strings/strip.h>

#include "client/cli/diagnosis/board.h"
#include "client/cli/diagnosis/comparison.h"
#include "client/cli/options/model_output.h"
#include "server/base/status.h"
#include "server/model/model.h"

namespace touchstone::cli {
namespace {

struct DiagnoseOptions : ComparisonOptions {
  std::string save_model;
  std::string keep_as;
  bool with_formula = false;
  bool with_surface_map = false;
  BoardOptions board;
};

// The improved model with the formula of what no built-in effect explains, or the curve, in its place; of several kinds of
// measurement the first's. Empty: there is none.
std::string SuggestedModel(const v1::Report& report) {
  for (const v1::DataReport& data : report.data())
    if (!data.unexplained().model_yaml().empty()) return data.unexplained().model_yaml();
  return "";
}

// The improved model as the report has it, or the model itself where nothing had to change.
absl::Status SaveModel(const Cli& cli, const DiagnoseOptions& options, const v1::Report& report,
                       Comparison* comparison) {
  std::string yaml = options.with_formula ? SuggestedModel(report) : "";
  if (options.with_formula && yaml.empty())
    cli.Log("--with-formula: this report suggests no formula and no curve");
  if (yaml.empty()) yaml = report.improved_model_yaml();
  const bool changed = !yaml.empty();
  if (!changed) {
    v1::GetModelRequest request;
    *request.mutable_model() = comparison->evidence().model();
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::Model same,
                                comparison->connection().Call(&v1::Models::Stub::GetModel, request));
    yaml = same.yaml();
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const model::Model model,
                              WriteModelText(cli, "--save-model", options.save_model, yaml));
  const std::string hash = model.Hash().substr(0, 12);
  cli.LogWritten(options.save_model,
                 changed ? absl::StrCat(" (", model.name, ", hash ", hash, ")")
                         : absl::StrCat(": the same model, nothing had to change (hash ", hash, ")"));
  return absl::OkStatus();
}

// Before hours of work: that the server has no model of that name.
absl::Status CheckKeepAs(const DiagnoseOptions& options, Comparison* comparison) {
  v1::GetModelRequest request;
  request.mutable_model()->set_name(options.keep_as);
  const absl::StatusOr<v1::Model> taken = comparison->connection().Call(&v1::Models::Stub::GetModel, request);
  if (!taken.ok()) return absl::OkStatus();  // what else is wrong with the name, the diagnosis says at once
  return absl::AlreadyExistsError(absl::StrCat("--keep-as: the server has a model '", options.keep_as,
                                               "' already (hash ", taken->hash().substr(0, 12),
                                               "); give another name"));
}

absl::Status RunDiagnose(const Cli& cli, const DiagnoseOptions& options) {
  if (options.sets.size() > 1) {
    for (const auto& [given, name] : {std::pair{options.with_formula, "--with-formula"},
                                      std::pair{options.with_surface_map, "--with-surface-map"},
                                      std::pair{!options.board.corners.empty(), "--board"}})
      if (given)
        return absl::InvalidArgumentError(
            absl::StrCat(name, ": is for one SET, and ", options.sets.size(), " are given"));
  }
  if (!options.board.corners.empty()) {
    for (const auto& [given, name] : {std::pair{options.with_formula, "--with-formula"},
                                      std::pair{options.with_surface_map, "--with-surface-map"},
                                      std::pair{!options.keep_as.empty(), "--keep-as"}})
      if (given)
        return absl::InvalidArgumentError(
            absl::StrCat(name, ": is not for pictures of a board (--board); leave it out"));
    return RunBoardDiagnosis(cli, options, options.board, options.save_model);
  }
  if (!options.board.save_camera.empty())
    return absl::InvalidArgumentError(
        "--save-camera: the lens of what board? Give --board, for instance 9x6, and --square-mm");
  if (options.board.square_mm != 0)
    return absl::InvalidArgumentError(
        "--square-mm: the side of a square of what board? Give --board, for instance 9x6");
  TOUCHSTONE_RETURN_IF_ERROR(CheckNoMeshes(
      cli, {{"--html", options.html}, {"--json", options.json}, {"--save-model", options.save_model}}));
  if (!options.keep_as.empty() && cli.source().servers.empty())
    return absl::InvalidArgumentError(
        "--keep-as: a server keeps models; give --server, or --save-model for a file");
  if (options.with_formula && options.save_model.empty())
    return absl::InvalidArgumentError(
        "--with-formula: it says what --save-model writes; give --save-model FILE");
  if (options.with_surface_map && options.save_model.empty() && options.keep_as.empty())
    return absl::InvalidArgumentError(
        "--with-surface-map: it says what --save-model writes; give --save-model FILE");
  if (options.with_surface_map && !SurfaceMapPath(options.save_model).empty())
    TOUCHSTONE_RETURN_IF_ERROR(
        cli.CheckOutputs({{"--with-surface-map", SurfaceMapPath(options.save_model)}}));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto comparison, Comparison::Open(cli, options));
  if (!options.keep_as.empty()) TOUCHSTONE_RETURN_IF_ERROR(CheckKeepAs(options, comparison.get()));
  v1::DiagnoseRequest request;
  absl::Status kept;
  request.set_with_surface_map(options.with_surface_map);
  request.set_save_model(options.keep_as);
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const v1::Report report,
      comparison->Run<v1::DiagnoseResponse>(
          [&](grpc::ClientContext* context) {
            *request.mutable_evidence() = comparison->evidence();
            *request.mutable_further() = {comparison->further().begin(), comparison->further().end()};
            return comparison->connection().diagnosis().Diagnose(context, request);
          },
          &kept));
  TOUCHSTONE_RETURN_IF_ERROR(PrintReport(cli, options, report));
  if (!options.save_model.empty())
    TOUCHSTONE_RETURN_IF_ERROR(SaveModel(cli, options, report, comparison.get()));
  if (!kept.ok())
    return absl::Status(
        kept.code(), absl::StrCat("--keep-as: the report is whole, but the server does not keep the model: ",
                                  absl::StripPrefix(kept.message(), "save_model: "),
                                  "; write it with --save-model FILE, or diagnose again with another "
                                  "name"));
  if (!options.keep_as.empty()) cli.Log(absl::StrCat("the server keeps the model as ", options.keep_as));
  return absl::OkStatus();
}

}  // namespace

void AddDiagnose(Cli* cli) {
  auto options = std::make_shared<DiagnoseOptions>();
  options->max_sets = kMaxSessions;
  options->further_meshes = true;  // one of them may be what was touched
  CLI::App* command = cli->AddCommand(
      nullptr, "diagnose",
      "Says how wrong a model is against measured touches or photographs, where, why, and what to add, until "
      "the rest is noise.",
      "touchstone diagnose set.csv --model nominal.yaml --mesh-dir meshes\n"
      "touchstone diagnose set.csv --model nominal.yaml --mesh cup=cup.off --save-model better.yaml\n"
      "touchstone diagnose set.csv --model nominal.yaml --mesh-dir meshes --html report.html "
      "--json report.json\n"
      "touchstone diagnose set.csv --model nominal.yaml --mesh-dir meshes --save-model better.yaml "
      "--with-formula\n"
      "touchstone diagnose set.csv --model nominal.yaml --mesh-dir meshes --save-model better.yaml "
      "--with-surface-map\n"
      "touchstone diagnose set.csv --model nominal.yaml --mesh-dir meshes --also my_effect.yaml\n"
      "touchstone diagnose monday.csv friday.csv --model nominal.yaml --mesh-dir meshes   what changed\n"
      "touchstone diagnose photos --model nominal.yaml --mesh-dir meshes --html report.html\n"
      "touchstone diagnose photos --board 9x6 --square-mm 25 --save-model lens.yaml\n"
      "touchstone diagnose photos --board 9x6 --square-mm 25 --save-camera camera.yaml\n"
      "touchstone diagnose set.csv --model nominal.yaml --mesh-dir meshes --server 127.0.0.1:50051",
      [cli, options] { return RunDiagnose(*cli, *options); });
  AddComparisonOptions(cli, command, options.get(), /*html=*/true);
  cli->AddOutput(command, "--save-model", &options->save_model,
                 "Write the improved model to this file; of several sessions that of the last");
  command->add_flag("--with-formula", options->with_formula,
                    "With --save-model: add the suggested formula, or the curve, of what no built-in effect "
                    "explains");
  command->add_flag(
      "--with-surface-map", options->with_surface_map,
      "With --save-model: where the surfaces depart from their meshes, write a map of them beside "
      "the model (FILE's name with .surface.csv), which the model then applies");
  AddBoardOptions(command, &options->board);
  cli->AddOutput(command, "--save-camera", &options->board.save_camera,
                 "With --board: write the lens with all that was found as a camera.yaml");
  command
      ->add_option("--keep-as", options->keep_as,
                   "With --server: keep the improved model there under this name, served at once")
      ->type_name("NAME");
}

}  // namespace touchstone::cli
