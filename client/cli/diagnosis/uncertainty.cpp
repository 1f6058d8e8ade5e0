// touchstone uncertainty: how well a fitted model predicts touches.
#include "client/cli/common/terminal.h"
#include "client/cli/diagnosis/comparison.h"
#include "client/cli/options/report_posterior.h"
#include "client/report/report.h"
#include "server/base/status.h"

namespace touchstone::cli {
namespace {

struct UncertaintyOptions : ComparisonOptions {
  std::string report;
};

absl::Status RunUncertainty(const Cli& cli, const UncertaintyOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckNoMeshes(cli, {{"--json", options.json}}));
  v1::UncertaintyRequest request;
  TOUCHSTONE_ASSIGN_OR_RETURN(ReportedPosterior reported, PosteriorOfReport(options.report));
  if (!reported.note.empty()) cli.Log(reported.note);
  *request.mutable_posterior() = std::move(reported.posterior);
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto comparison, Comparison::Open(cli, options));
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::Report report,
                              comparison->Run<v1::UncertaintyResponse>([&](grpc::ClientContext* context) {
                                *request.mutable_evidence() = comparison->evidence();
                                return comparison->connection().diagnosis().Uncertainty(context, request);
                              }));
  TOUCHSTONE_RETURN_IF_ERROR(WriteReportFiles(cli, options, report));
  if (options.ReportOnStdout()) return absl::OkStatus();
  return cli.Print(client::TerminalUncertainty(report, TerminalWidth(), ColourOnStdout()));
}

}  // namespace

void AddUncertainty(Cli* cli) {
  auto options = std::make_shared<UncertaintyOptions>();
  options->takes_models = false;
  options->set_name = "PLAN";
  options->set_text = kPlanText;
  CLI::App* command = cli->AddCommand(
      nullptr, "uncertainty",
      "Says how well a fitted model predicts touches: the standard uncertainty of a contact time, object by "
      "object, "
      "and what it comes from (values of the model, surface, repeatability, reproducibility).",
      "touchstone diagnose set.csv --model nominal.yaml --mesh-dir meshes --json report.json\n"
      "touchstone uncertainty report.json plan.csv --mesh-dir meshes\n"
      "touchstone uncertainty report.json plan.csv --mesh-dir meshes --json - | jq .uncertainty\n"
      "touchstone stream --uncertainty report.json --plan faces --to hdf5 --out data    of every sample",
      [cli, options] { return RunUncertainty(*cli, *options); });
  CLI::Option* report = command->add_option(
      "REPORT", options->report, "The report of the diagnosis that found the model (diagnose --json)");
  report->required()->type_name("");
  cli->AddInput(command, report);
  AddComparisonOptions(cli, command, options.get(), /*html=*/false);
}

}  // namespace touchstone::cli
