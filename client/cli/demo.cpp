// touchstone demo: an emulated rig that hides an effect is touched through the gateway, and what its touches say about the
// model is found, added, and shown.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include "client/cli/common/browser.h"
#include "client/cli/common/child_program.h"
#include "client/cli/common/common.h"
#include "client/cli/common/interrupt.h"
#include "client/cli/common/provenance.h"
#include "server/base/status.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;

struct DemoFlags {
  std::string folder = "touchstone-demo", objects = "lat10,lat20";
  bool open = false;
};

constexpr char kRigLog[] = "rig/emulator.out";
// Files that it makes; beside kRigLog lies what the emulated rig and the gateway write.
constexpr const char* kFiles[] = {kRigLog,        "plan.csv",   "path.svg",    "session.db",
                                  "nominal.yaml", "model.yaml", "better.yaml", "report.html"};

class Demo {
 public:
  Demo(const Cli& cli, const DemoFlags& flags) : cli_(cli), flags_(flags) {}

  absl::Status Run() {
    ::unsetenv("TOUCHSTONE_SERVER");          // it brings its own programs
    const Interrupt::Handler handler([] {});  // those who wait for programs look whether it was raised
    TOUCHSTONE_RETURN_IF_ERROR(MakeFolder());
    TOUCHSTONE_RETURN_IF_ERROR(Touch());
    TOUCHSTONE_RETURN_IF_ERROR(Diagnose());
    const auto took = std::chrono::steady_clock::now() - began_;
    const double took_s = std::chrono::duration<double>(took).count();
    if (cli_.output().json) {
      PrintJson({{"report", Path("report.html")},
                 {"session", Path("session.db")},
                 {"model", Path("model.yaml")},
                 {"better_model", Path("better.yaml")},
                 {"log", log_},
                 {"took_s", took_s}});
    } else {
      Say(absl::StrCat("\nDone in ", absl::StrFormat("%.0f", took_s),
                       " s. What the model lacked, in any browser: ", Path("report.html"),
                       "\nThe same page live, to find, add and undo: touchstone workbench ",
                       ShellWord(Path("session.db")), " --model ", ShellWord(Path("model.yaml")),
                       " --open\n"));
    }
    if (flags_.open) OpenInBrowser(cli_, Path("report.html"));
    return absl::OkStatus();
  }

 private:
  std::string Path(const std::string& name) const { return (fs::path(flags_.folder) / name).string(); }

  absl::Status MakeFolder() {
    std::vector<OutputFile> outputs;
    for (const char* file : kFiles)
      outputs.push_back({"-o", Path(file), OutputKind::kFile, /*makes_folders=*/true});
    TOUCHSTONE_RETURN_IF_ERROR(cli_.CheckOutputs(outputs));
    std::error_code error;
    if (fs::exists(Path("rig"), error) && !fs::exists(Path(kRigLog), error))
      return absl::AlreadyExistsError(
          absl::StrCat(Path("rig"), " exists already and is no demo's; choose another folder with -o"));
    // The emulated rig begins anew; a journal that is there would be resumed.
    fs::remove_all(Path("rig"), error);
    for (const char* end : {"", "-wal", "-shm"}) fs::remove(Path("session.db") + end, error);
    fs::create_directories(Path("rig"), error);
    if (error)
      return absl::FailedPreconditionError(
          absl::StrCat("-o ", flags_.folder, ": the folder cannot be made: ", error.message()));
    if (cli_.output().json) {
      log_ = Path("demo.log");
      fs::remove(log_, error);
    }
    return absl::OkStatus();
  }

  void Say(const std::string& text) {
    if (cli_.output().json) return;
    cli_.Print(text).IgnoreError();
    std::fflush(stdout);  // before programs that print there too
  }

  // A command of this program, as the user would type it.
  absl::Status Command(std::vector<std::string> words) {
    std::vector<std::string> shown;
    for (const std::string& word : words) shown.push_back(ShellWord(word));
    Say(absl::StrCat("$ touchstone ", absl::StrJoin(shown, " "), "\n"));
    if (cli_.output().quiet) words.push_back("--quiet");
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto program, ChildProgram::Start("touchstone", words, log_));
    const absl::Status done = program->Wait();
    if (done.ok() || absl::IsCancelled(done)) return done;
    return absl::Status(done.code(),
                        absl::StrCat("touchstone ", absl::StrJoin(shown, " "), ": ", done.message(),
                                     log_.empty() ? "; it says above why" : "; " + log_ + " says why"));
  }

  absl::Status Touch() {
    Say("== Touch: an emulated rig, 120 times as fast as a real one would be, and the gateway before it\n");
    // Its fingers end in balls of 2 mm, which no model here knows. No photographs are taken, and a build may have no camera.
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const auto rig,
        ChildProgram::Start("touchstone-rig-emulator",
                            {"--dir", Path("rig"), "--speedup", "120", "--hide", "tip_radius.radius_mm=2",
                             "--sigma-us", "5000", "--seed", "7", "--no-camera"},
                            Path(kRigLog)));
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string configuration, rig->WaitUntilReady("ready"));
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const auto gateway,
        ChildProgram::Start("touchstone-gateway", {"--config", configuration, "--listen", "127.0.0.1:0"},
                            Path("rig/gateway.log")));
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string address, gateway->WaitUntilReady("listening on"));
    Say(absl::StrCat("The gateway serves at ", address, "; logs: ", Path("rig"), "\n"));
    TOUCHSTONE_RETURN_IF_ERROR(Command({"rig", "status", "--server", address, "--wait-s", "60"}));
    TOUCHSTONE_RETURN_IF_ERROR(
        Command({"plan", flags_.objects, "--plan", "faces", "-o", Path("plan.csv"), "--force"}));
    TOUCHSTONE_RETURN_IF_ERROR(Command(
        {"rig", "dry-run", Path("plan.csv"), "--server", address, "-o", Path("path.svg"), "--force"}));
    TOUCHSTONE_RETURN_IF_ERROR(
        Command({"rig", "run", Path("plan.csv"), "--server", address, "-o", Path("session.db")}));
    TOUCHSTONE_RETURN_IF_ERROR(gateway->Stop());
    TOUCHSTONE_RETURN_IF_ERROR(rig->Stop());
    Say("Gateway and emulated rig ended cleanly. What they made is emulated: nothing was measured on "
        "anything.\n");
    return absl::OkStatus();
  }

  absl::Status Diagnose() {
    Say("\n== Find what the model lacks: the session of the emulated rig, diagnosed\n");
    const std::string model = Path("model.yaml"), better = Path("better.yaml");
    TOUCHSTONE_RETURN_IF_ERROR(Command({"model", "new", "-o", Path("nominal.yaml"), "--force"}));
    TOUCHSTONE_RETURN_IF_ERROR(Command(
        {"model", "add", Path("nominal.yaml"), "gaussian_noise", "sigma_us=5000", "-o", model, "--force"}));
    TOUCHSTONE_RETURN_IF_ERROR(Command({"diagnose", Path("session.db"), "--model", model, "--html",
                                        Path("report.html"), "--save-model", better, "--force"}));
    return Command({"model", "diff", model, better});
  }

  const Cli& cli_;
  const DemoFlags& flags_;
  const std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
  std::string log_;  // where the output of commands goes; empty: to this one's
};

}  // namespace

void AddDemo(Cli* cli) {
  auto flags = std::make_shared<DemoFlags>();
  CLI::App* command = cli->AddCommand(nullptr, "demo",
                                      "An emulated rig that hides an effect is touched through the gateway; "
                                      "the diagnosis finds the effect, and a page shows "
                                      "it. Needs no rig, no server and no other file.",
                                      "touchstone demo --open\n"
                                      "touchstone demo -o first --objects lat00,lat10,lat20",
                                      [cli, flags] { return Demo(*cli, *flags).Run(); });
  cli->AddOutput(command, "-o,--out", &flags->folder,
                 "Folder for the session, the models and report.html; made if it is not there",
                 OutputKind::kPrefix)
      ->type_name("FOLDER")
      ->capture_default_str();
  command->add_option("--objects", flags->objects, "What is touched, 192 times each; about 12 s an object")
      ->type_name("NAMES")
      ->capture_default_str();
  command->add_flag("--open", flags->open, "Open the page in the browser");
}

}  // namespace touchstone::cli
