#include <spdlog/spdlog.h>

#include <cstdio>
#include <cstdlib>

#include "client/cli/common/common.h"
#include "client/cli/common/exit_code.h"
#include "client/cli/common/interrupt.h"
#include "server/base/process/out_of_memory.h"

namespace touchstone::cli {

// One line a command; each is a file of its own.
void AddCommands(Cli* cli) {
  AddDemo(cli);
  AddObjects(cli);
  AddEffects(cli);
  AddModel(cli);
  AddPlan(cli);
  AddTouch(cli);
  AddCapture(cli);
  AddStream(cli);
  AddDataset(cli);
  AddMesh(cli);
  AddNormalize(cli);
  AddCompare(cli);
  AddDiagnose(cli);
  AddExplain(cli);
  AddUncertainty(cli);
  AddHistory(cli);
  AddCheck(cli);
  AddRehearse(cli);
  AddPropose(cli);
  AddWorkbench(cli);
  AddSession(cli);
  AddRig(cli);
  AddToken(cli);
  AddPythonCommands(cli);
  AddDoctor(cli);
  AddHelp(cli);
}

}  // namespace touchstone::cli

int main(int argc, char** argv) {
#ifdef __AVX2__
  // Built for x86-64-v3: on an older processor everything after this would end in an illegal instruction.
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma") || !__builtin_cpu_supports("bmi2")) {
    std::fputs(
        "touchstone: error: this build needs a processor with AVX2, FMA and BMI2 (x86-64-v3); "
        "configure it with -DTOUCHSTONE_ARCH= for older ones\n",
        stderr);
    return touchstone::cli::kRefused;
  }
#endif
  // gRPC's own lines about failed handshakes: what is wrong is said in words (tls_probe.h). Set it to see them.
  ::setenv("GRPC_VERBOSITY", "NONE", /*overwrite=*/0);
  // A source in this process keeps no log: stdout and stderr are the command's.
  spdlog::set_level(spdlog::level::off);
  touchstone::cli::Interrupt::Install();
  return touchstone::RunWithinMemory("touchstone", touchstone::cli::kRefused, [&] {
    touchstone::cli::Cli cli;
    touchstone::cli::AddCommands(&cli);
    return cli.Run(argc, argv);
  });
}
