// touchstone workbench: the live page. See where a model fails, add the effect that is missing, watch the error fall.
#include <condition_variable>
#include <cstdio>
#include <iostream>
#include <mutex>

#include "client/cli/common/browser.h"
#include "client/cli/diagnosis/comparison.h"
#include "client/workbench_server/workbench.h"
#include "server/base/status.h"

namespace touchstone::cli {
namespace {

constexpr int kMaxPort = 65535;

struct WorkbenchFlags : ComparisonOptions {
  int port = 0;
  bool open = false;
};

// The model as text, which the page changes.
absl::Status NameModel(client::Connection* connection, v1::Evidence* evidence) {
  v1::GetModelRequest request;
  *request.mutable_model() = evidence->model();
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::Model model, connection->Call(&v1::Models::Stub::GetModel, request));
  evidence->mutable_model()->set_yaml(model.yaml());
  return absl::OkStatus();
}

void WaitForInterrupt() {
  std::mutex mutex;
  std::condition_variable came;
  bool ended = false;
  const Interrupt::Handler handler([&] {
    const std::lock_guard<std::mutex> lock(mutex);
    ended = true;
    came.notify_all();
  });
  std::unique_lock<std::mutex> lock(mutex);
  came.wait(lock, [&] { return ended || Interrupt::Raised(); });
}

absl::Status RunWorkbench(const Cli& cli, const WorkbenchFlags& options) {
  if (options.port < 0 || options.port > kMaxPort)
    return absl::InvalidArgumentError(
        absl::StrCat("--port: ", options.port, " is out of range; 0 to ", kMaxPort));
  if (options.sets.empty() && !options.models.empty())
    return absl::InvalidArgumentError(
        "--model: the model of what measurements? Give SET, for instance set.csv");
  std::unique_ptr<Comparison> comparison;
  std::unique_ptr<client::Connection> alone;
  workbench::WorkbenchOptions served;
  if (options.sets.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(alone, cli.Connect());
  } else {
    TOUCHSTONE_ASSIGN_OR_RETURN(comparison, Comparison::Open(cli, options));
    TOUCHSTONE_RETURN_IF_ERROR(comparison->SendAheadNow());
    served.evidence = comparison->evidence();
    served.send_ahead_again = [&comparison](const std::shared_ptr<grpc::Channel>& server) {
      return comparison->SendAheadAgain(server);
    };
    TOUCHSTONE_RETURN_IF_ERROR(NameModel(&comparison->connection(), &*served.evidence));
  }
  served.port = options.port;
  served.connection = comparison ? &comparison->connection() : alone.get();
  served.log = [&cli](const std::string& line) { cli.Log(line); };
  if (!cli.source().rig.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(served.rig, cli.ConnectToRigBeside());
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto page, workbench::Workbench::Start(std::move(served)));
  TOUCHSTONE_RETURN_IF_ERROR(cli.Print(absl::StrCat(page->Url(), "\n")));
  std::fflush(stdout);  // a reader of a pipe waits for it
  std::cout.flush();
  cli.Log("the page is at this address, for this machine alone; Ctrl-C ends it");
  RedirectFile redirect;
  if (options.open) {
    TOUCHSTONE_ASSIGN_OR_RETURN(redirect, RedirectFile::To(page->Url()));
    OpenInBrowser(cli, redirect.path(), page->Url());
  }
  WaitForInterrupt();
  return absl::OkStatus();
}

}  // namespace

void AddWorkbench(Cli* cli) {
  auto options = std::make_shared<WorkbenchFlags>();
  options->set_required = false;
  options->further_meshes = true;
  CLI::App* command =
      cli->AddCommand(nullptr, "workbench",
                      "Serves a page on this machine: see where a model fails, add the effect that is "
                      "missing, watch the error fall.",
                      "touchstone workbench --open                                  offers an example\n"
                      "touchstone workbench set.csv --model nominal.yaml --mesh-dir meshes --open\n"
                      "touchstone workbench set.csv --model nominal.yaml --server 127.0.0.1:50051\n"
                      "touchstone workbench --rig 127.0.0.1:50052 --open              works a rig, too",
                      [cli, options] { return RunWorkbench(*cli, *options); });
  AddComparisonOptions(cli, command, options.get(), /*html=*/false);
  cli->AddRigBeside(command);
  command->add_option("--port", options->port, "Port at 127.0.0.1. Default: 0, any that is free")
      ->type_name("N");
  command->add_flag("--open", options->open, "Open the page in the browser");
}

}  // namespace touchstone::cli
