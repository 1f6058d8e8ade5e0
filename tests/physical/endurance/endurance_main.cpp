// touchstone-rig-endurance: how fast, how punctual and how sound the gateway is on an emulated rig.
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <string>

#include "tests/physical/endurance/endurance.h"
#include "tests/physical/endurance/measure.h"

namespace {

constexpr char kUsage[] =
    "touchstone-rig-endurance endurance [TOUCHES [SPEEDUP [FAULT_SHARE [SEED [JOURNAL]]]]]\n"
    "    JOURNAL: goes on with what an earlier run left there, and leaves its own\n"
    "touchstone-rig-endurance overhead [TOUCHES [SPEEDUP]]\n"
    "touchstone-rig-endurance cpu [SECONDS]\n"
    "touchstone-rig-endurance stop [REPEATS]\n"
    "touchstone-rig-endurance clock [TOUCHES [SPEEDUP [WARM_UP_S]]]\n"
    "Everything is measured against an emulated rig; the program touchstone-gateway must lie beside this "
    "one.\n";

double Number(int argc, char** argv, int k, double otherwise) {
  return argc > k ? std::atof(argv[k]) : otherwise;
}

// Without it every touch would be tried again for ever.
bool GatewayIsBeside() {
  std::error_code error;
  const std::filesystem::path gateway =
      std::filesystem::read_symlink("/proc/self/exe", error).replace_filename("touchstone-gateway");
  if (std::filesystem::exists(gateway, error)) return true;
  std::fprintf(stderr, "touchstone-rig-endurance: %s: not there; the program was expected beside this one\n",
               gateway.c_str());
  return false;
}

int RunEndurance(int argc, char** argv) {
  touchstone::EnduranceOptions options;
  options.touches = static_cast<uint64_t>(Number(argc, argv, 2, 100'000));
  options.speedup = Number(argc, argv, 3, options.speedup);
  options.fault_share = Number(argc, argv, 4, 0.02);
  options.seed = static_cast<uint64_t>(Number(argc, argv, 5, 1));
  if (argc > 6) options.journal = argv[6];
  touchstone::Endurance endurance(options);
  const touchstone::EnduranceReport report = endurance.Run([](const touchstone::EnduranceReport& so_far) {
    std::printf("-- so far\n%s", so_far.Text().c_str());
    std::fflush(stdout);
  });
  std::printf("== endurance, seed %llu, %g times as fast, faults in %g of the attempts: %s\n%s",
              static_cast<unsigned long long>(options.seed), options.speedup, options.fault_share,
              report.Sound() ? "sound" : "NOT SOUND", report.Text().c_str());
  return report.Sound() ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  const std::string what = argc > 1 ? argv[1] : "";
  if (!what.empty() && !GatewayIsBeside()) return 2;
  if (what == "endurance") return RunEndurance(argc, argv);
  if (what == "overhead")
    return touchstone::MeasureOverhead(static_cast<int>(Number(argc, argv, 2, 60)), Number(argc, argv, 3, 4));
  if (what == "cpu") return touchstone::MeasureCpu(Number(argc, argv, 2, 30));
  if (what == "stop") return touchstone::MeasureStop(static_cast<int>(Number(argc, argv, 2, 100)));
  if (what == "clock")
    return touchstone::MeasureClock(static_cast<int>(Number(argc, argv, 2, 30)), Number(argc, argv, 3, 1),
                                    Number(argc, argv, 4, 60));
  std::fputs(kUsage, stderr);
  return 2;
}
