// touchstone propose: what to touch next, to tell the explanations apart that are left.
#include <absl/strings/str_join.h>

#include <map>

#include "client/cli/comparison.h"
#include "client/source/measurement_csv.h"
#include "server/base/status.h"

namespace touchstone::cli {
namespace {

struct ProposeOptions : ComparisonOptions {
  uint32_t touches = 24;
  std::string output;
};

absl::Status RunPropose(const Cli& cli, const ProposeOptions& options) {
  if (options.touches < 1)
    return absl::InvalidArgumentError("--touches: 0 is out of range; 1 or more was expected");
  TOUCHSTONE_RETURN_IF_ERROR(CheckNoMeshes(cli, {{"--json", options.json}, {"-o", options.output}}));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto comparison, Comparison::Open(cli, options));
  v1::ProposeRequest request;
  *request.mutable_evidence() = comparison->evidence();
  request.set_touches(options.touches);
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::Report report,
                              comparison->Run<v1::ProposeResponse>([&](grpc::ClientContext* context) {
                                return comparison->connection().diagnosis().Propose(context, request);
                              }));

  std::vector<client::MeasuredTouch> plan;
  std::map<std::string, int> purposes;
  for (const v1::ProposedTouch& proposed : report.next_touches()) {
    client::MeasuredTouch touch;
    touch.touch = plan.size();
    touch.object = proposed.object();
    touch.commanded = proposed.touch();
    plan.push_back(std::move(touch));
    ++purposes[proposed.purpose()];
  }
  for (const auto& [purpose, touches] : purposes)
    cli.Log(absl::StrCat(Counted(touches, "touch", "touches"), ": ", purpose));
  // What no touch can decide needs another measurement.
  for (const v1::Ambiguity& ambiguity : report.ambiguities())
    if (!ambiguity.discriminating_measurement().empty())
      cli.Log(absl::StrCat("to tell ", absl::StrJoin(ambiguity.effects(), " from "), ": ",
                           ambiguity.discriminating_measurement()));
  TOUCHSTONE_RETURN_IF_ERROR(WriteReportFiles(cli, options, report));
  if (plan.empty()) {
    cli.Log("no touches to propose: no explanations are left that further touches would tell apart");
    return absl::OkStatus();
  }
  if (options.ReportOnStdout() && options.output.empty()) return absl::OkStatus();
  TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.output, client::FormatMeasurements(plan)));
  cli.LogWritten(options.output, absl::StrCat(" (", Counted(plan.size(), "touch", "touches"), ")"));
  return absl::OkStatus();
}

}  // namespace

void AddPropose(Cli* cli) {
  auto options = std::make_shared<ProposeOptions>();
  CLI::App* command = cli->AddCommand(
      nullptr, "propose",
      "Writes a plan of the touches that would best tell apart the explanations that are left.",
      "touchstone propose set.csv --model nominal.yaml --mesh-dir meshes --touches 24 -o plan.csv\n"
      "touchstone touch --plan plan.csv -o more.csv",
      [cli, options] { return RunPropose(*cli, *options); });
  AddComparisonOptions(cli, command, options.get(), /*html=*/false);
  command->add_option("--touches", options->touches, "How many to propose. Default: 24")->type_name("N");
  cli->AddOutput(command, "-o,--output", &options->output, "The plan (CSV) to write. Default: stdout");
}

}  // namespace touchstone::cli
