// touchstone explain: why one effect is, or is not, what a model lacks.
#include "client/cli/common/terminal.h"
#include "client/cli/diagnosis/comparison.h"
#include "client/report/report.h"
#include "server/base/status.h"

namespace touchstone::cli {
namespace {

struct ExplainOptions : ComparisonOptions {
  std::string effect;
};

absl::Status RunExplain(const Cli& cli, const ExplainOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckNoMeshes(cli, {{"--json", options.json}}));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto comparison, Comparison::Open(cli, options));
  v1::ExplainRequest request;
  request.set_effect(options.effect);
  const absl::StatusOr<v1::Report> report =
      comparison->Run<v1::ExplainResponse>([&](grpc::ClientContext* context) {
        *request.mutable_evidence() = comparison->evidence();
        return comparison->connection().diagnosis().Explain(context, request);
      });
  if (!report.ok()) return WithEffectHint(report.status(), {options.effect});
  TOUCHSTONE_RETURN_IF_ERROR(WriteReportFiles(cli, options, *report));
  if (options.ReportOnStdout()) return absl::OkStatus();
  return cli.Print(client::TerminalExplanation(*report, TerminalWidth(), ColourOnStdout()));
}

}  // namespace

void AddExplain(Cli* cli) {
  auto options = std::make_shared<ExplainOptions>();
  options->set_text =
      "The measurement file (CSV) of touches with poses, or the journal (.db) of a rig's session; -: stdin; "
      "with "
      "--server also a stored session's name";
  CLI::App* command = cli->AddCommand(
      nullptr, "explain",
      "Says why one effect is, or is not, what a model lacks: its best value, what it leaves, which touches "
      "speak for "
      "and against it, and what others take over.",
      "touchstone explain oblique_slip set.csv --model nominal.yaml --mesh-dir meshes\n"
      "touchstone explain tip_radius set.csv --model nominal.yaml --mesh-dir meshes --json - | jq .explained",
      [cli, options] { return RunExplain(*cli, *options); });
  command->add_option("EFFECT", options->effect, "The effect (touchstone effects lists them)")->required();
  AddComparisonOptions(cli, command, options.get(), /*html=*/false);
}

}  // namespace touchstone::cli
