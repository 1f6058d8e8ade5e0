// touchstone compare: how wrong a model is, and where.
#include "client/cli/diagnosis/comparison.h"
#include "server/base/status.h"

namespace touchstone::cli {
namespace {

absl::Status RunCompare(const Cli& cli, const ComparisonOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckNoMeshes(cli, {{"--html", options.html}, {"--json", options.json}}));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto comparison, Comparison::Open(cli, options));
  v1::CompareRequest request;
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const v1::Report report, comparison->Run<v1::CompareResponse>([&](grpc::ClientContext* context) {
        *request.mutable_evidence() = comparison->evidence();
        *request.mutable_further() = {comparison->further().begin(), comparison->further().end()};
        if (comparison->other_model()) *request.mutable_other_model() = *comparison->other_model();
        return comparison->connection().diagnosis().Compare(context, request);
      }));
  return PrintReport(cli, options, report);
}

}  // namespace

void AddCompare(Cli* cli) {
  auto options = std::make_shared<ComparisonOptions>();
  options->max_models = 2;
  options->max_sets = kMaxSessions;
  CLI::App* command = cli->AddCommand(
      nullptr, "compare",
      "Says how wrong a model is against measured touches or photographs, and where; of two models, which "
      "errs less.",
      "touchstone compare set.csv --model nominal.yaml --mesh-dir meshes\n"
      "touchstone compare set.csv --model nominal.yaml --model better.yaml --mesh-dir meshes   which errs "
      "less\n"
      "touchstone compare monday.csv friday.csv --model better.yaml --mesh-dir meshes   session by session\n"
      "touchstone compare set.csv --model better.yaml --mesh cup=cup.off --html report.html\n"
      "touchstone compare set.csv --model nominal.yaml --mesh-dir meshes --json - | jq '.data[0].initial'\n"
      "touchstone compare photos --model nominal.yaml --mesh-dir meshes --html report.html",
      [cli, options] { return RunCompare(*cli, *options); });
  AddComparisonOptions(cli, command, options.get(), /*html=*/true);
}

}  // namespace touchstone::cli
