// touchstone check: what a plan can find, before any touch is made.
#include <absl/strings/str_split.h>

#include <cmath>
#include <optional>

#include "client/cli/common/terminal.h"
#include "client/cli/diagnosis/comparison.h"
#include "client/cli/diagnosis/proposed_touches.h"
#include "client/report/report.h"
#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::cli {
namespace {

// A second; no sensor scatters so much that another would be of use.
constexpr double kMaxNoiseUs = 1e6;

struct CheckOptions : ComparisonOptions {
  std::optional<double> noise_us;
  uint32_t improve = 0;
  std::string find, between, output;
};

absl::Status CheckQuestion(const CheckOptions& options) {
  if (options.noise_us && !(*options.noise_us > 0 && *options.noise_us <= kMaxNoiseUs))
    return absl::InvalidArgumentError(absl::StrCat("--noise: ", ShortestNumber(*options.noise_us),
                                                   " us is out of range; above 0 to ",
                                                   static_cast<int>(kMaxNoiseUs), " us was expected"));
  const bool asked = !options.find.empty() || !options.between.empty();
  if (options.improve > 0 && options.output.empty())
    return absl::InvalidArgumentError("--improve: -o FILE was expected, where the touches are written");
  if (options.improve > 0 && (!asked || (!options.find.empty() && !options.between.empty())))
    return absl::InvalidArgumentError(
        "--improve: which touches help depends on the question; one of --find EFFECT and --between "
        "EFFECT,EFFECT was "
        "expected");
  if (options.improve == 0 && (asked || !options.output.empty()))
    return absl::InvalidArgumentError(
        "--find, --between and -o belong to --improve N, the touches to propose");
  return absl::OkStatus();
}

absl::Status RunCheck(const Cli& cli, const CheckOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckQuestion(options));
  TOUCHSTONE_RETURN_IF_ERROR(
      CheckNoMeshes(cli, {{"--html", options.html}, {"--json", options.json}, {"-o", options.output}}));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto comparison, Comparison::Open(cli, options));
  v1::CheckRequest request;
  request.set_noise_us(options.noise_us.value_or(0));
  request.set_improve(options.improve);
  request.set_find(options.find);
  if (!options.between.empty())
    for (const absl::string_view effect : absl::StrSplit(options.between, ','))
      request.add_between(std::string(effect));
  const absl::StatusOr<v1::Report> checked =
      comparison->Run<v1::CheckResponse>([&](grpc::ClientContext* context) {
        *request.mutable_evidence() = comparison->evidence();
        return comparison->connection().diagnosis().Check(context, request);
      });
  std::vector<std::string> asked = {request.between().begin(), request.between().end()};
  asked.push_back(options.find);
  if (!checked.ok()) return WithEffectHint(checked.status(), asked);
  const v1::Report& report = *checked;
  TOUCHSTONE_RETURN_IF_ERROR(WriteReportFiles(cli, options, report));
  if (!options.ReportOnStdout())
    TOUCHSTONE_RETURN_IF_ERROR(cli.Print(client::TerminalCheck(report, TerminalWidth(), ColourOnStdout())));
  if (options.improve == 0) return absl::OkStatus();
  if (report.next().empty()) {
    cli.Log("no touch to propose: none would help with that question");
    return absl::OkStatus();
  }
  TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.output, PlanOfTouches(report)));
  cli.LogWritten(options.output, absl::StrCat(" (", Counted(report.next_size(), "touch", "touches"), ": ",
                                              report.next(0).purpose(), ")"));
  return absl::OkStatus();
}

}  // namespace

void AddCheck(Cli* cli) {
  auto options = std::make_shared<CheckOptions>();
  options->set_name = "PLAN";
  options->set_text = kPlanText;
  CLI::App* command = cli->AddCommand(
      nullptr, "check",
      "Says what a plan of touches can find before any is made: from which size each effect is found, what "
      "it is "
      "told from, and what is missed.",
      "touchstone plan lat20 -o plan.csv\n"
      "touchstone check plan.csv --model nominal.yaml --noise 5000\n"
      "touchstone check plan.csv --model nominal.yaml --noise 5000 --html plan.html\n"
      "touchstone check plan.csv --model nominal.yaml --noise 5000 --json - | jq '.detectable[0]'\n"
      "touchstone check plan.csv --model nominal.yaml --noise 5000 --improve 24 --between "
      "tip_radius,oblique_slip \\\n"
      "  -o more.csv",
      [cli, options] { return RunCheck(*cli, *options); });
  AddComparisonOptions(cli, command, options.get(), /*html=*/true);
  command
      ->add_option("--noise", options->noise_us,
                   "Standard deviation of one finger's time, us. Default: that of the model's noise")
      ->type_name("US");
  command
      ->add_option("--improve", options->improve,
                   "Propose N further touches that help with a question; with -o")
      ->type_name("N");
  command->add_option("--find", options->find, "The question: find this effect at smaller sizes")
      ->type_name("EFFECT");
  command->add_option("--between", options->between, "The question: tell two effects apart")
      ->type_name("EFFECT,EFFECT");
  cli->AddOutput(command, "-o,--output", &options->output,
                 "The plan (CSV) of the touches that --improve proposes");
}

}  // namespace touchstone::cli
