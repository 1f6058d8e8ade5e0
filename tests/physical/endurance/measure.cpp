#include "tests/physical/endurance/measure.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>

#include "tests/physical/physical_test.h"

namespace touchstone {
namespace {

double NowS() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void SleepS(double s) {
  std::this_thread::sleep_for(std::chrono::duration<double>(s));
}

// Of a sorted list.
double At(const std::vector<double>& sorted, double share) {
  return sorted[static_cast<size_t>(std::lround(share * static_cast<double>(sorted.size() - 1)))];
}

// Seconds that a process has spent computing.
double ComputedS(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/stat");
  std::string text((std::istreambuf_iterator<char>(file)), {});
  std::istringstream after(text.substr(text.rfind(')') + 2));
  std::string word;
  for (int k = 3; k < 14; ++k) after >> word;
  double user = 0, system = 0;
  after >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

class Bench : public PhysicalTest {
 public:
  int Cpu(double seconds);
  int Stop(int repeats);
  int Clock(int touches, double speedup, double warm_up_s);

 private:
  void TestBody() override {}
};

int Bench::Cpu(double seconds) {
  StartRig([](rig::EmulatorOptions* options) { options->speedup = 1; });
  StartGatewayProcess();
  SleepS(2);
  const auto print = [&](const char* what, double began_s, double computed_s) {
    std::printf("| %s | %.2f %% of a core | over %.1f s, %.0f states a second |\n", what,
                100 * (ComputedS(gateway_process()) - computed_s) / (NowS() - began_s), NowS() - began_s,
                RigState().arm().rate_hz());
    std::fflush(stdout);
  };
  double began_s = NowS(), computed_s = ComputedS(gateway_process());
  SleepS(seconds);
  print("idle", began_s, computed_s);

  KeptLease lease(control_.get(), "bench", true);
  if (!Touch(lease.token(), FromAbove(), "first").status.ok()) return 1;
  began_s = NowS(), computed_s = ComputedS(gateway_process());
  int touches = 0;
  while (NowS() - began_s < seconds) {
    const Answer answer =
        Touch(lease.token(), FromAbove(0.02, touches % 4), "touch " + std::to_string(touches));
    if (!answer.status.ok()) {
      std::fprintf(stderr, "error: %s\n", answer.status.error_message().c_str());
      return 1;
    }
    ++touches;
  }
  print(("busy: " + std::to_string(touches) + " touches one after the other").c_str(), began_s, computed_s);
  return 0;
}

int Bench::Stop(int repeats) {
  StartRig([](rig::EmulatorOptions* options) { options->speedup = 4; });
  StartGateway();
  std::vector<double> arrived_s, answered_s;
  for (int k = 0; k < repeats; ++k) {
    KeptLease lease(control_.get(), "bench", true);
    const uint64_t begun = emulator_->controller().Count("programs");
    auto touch = TouchLater(lease.token(), FromAbove(0.01), "stopped " + std::to_string(k));
    // The registers tell the phase of the touch before until this one's program has begun.
    WaitUntil([&] { return emulator_->controller().Count("programs") > begun; },
              "the touch's program begins");
    SleepS(0.05);
    WaitUntilApproaching();
    std::atomic<double> seen_s{0};
    std::atomic<bool> ending{false};
    const uint64_t programs = emulator_->controller().Count("programs");
    std::thread watch([&] {
      while (!ending && emulator_->controller().Count("programs") == programs) SleepS(20e-6);
      seen_s = NowS();
    });
    v1::StopResponse response;
    grpc::ClientContext context;
    const double began_s = NowS();
    const bool stopped = control_->Stop(&context, {}, &response).ok();
    answered_s.push_back(NowS() - began_s);
    const double give_up_s = NowS() + 5;
    while (seen_s == 0 && NowS() < give_up_s) SleepS(1e-3);
    const bool arrived = seen_s != 0;
    ending = true;
    watch.join();
    touch.get();
    if (!stopped || !arrived) {
      std::fprintf(stderr, "error: stop %d %s\n", k, stopped ? "did not arrive" : "was refused");
      return 1;
    }
    arrived_s.push_back(seen_s - began_s);
    WaitUntil([this] { return !emulator_->controller().Moving(); }, "the arm rests");
  }
  std::sort(arrived_s.begin(), arrived_s.end());
  std::sort(answered_s.begin(), answered_s.end());
  for (const auto& [name, times] : {std::pair("Control.Stop until the controller runs the stop", arrived_s),
                                    std::pair("Control.Stop until it is answered", answered_s)})
    std::printf("| %s | median %.2f ms | 99 %% %.2f ms | most %.2f ms | %zu stops in mid-approach |\n", name,
                1e3 * At(times, 0.5), 1e3 * At(times, 0.99), 1e3 * times.back(), times.size());
  return 0;
}

int Bench::Clock(int touches, double speedup, double warm_up_s) {
  StartRig([&](rig::EmulatorOptions* options) {
    options->speedup = speedup;
    options->drift_ppm = 100;
    options->faults = {{"line_delay_ms", 5}};
  });
  StartGateway();
  KeptLease lease(control_.get(), "bench", true);
  if (!Touch(lease.token(), FromAbove(), "first").status.ok()) return 1;
  SleepS(warm_up_s);
  std::vector<double> difference_us, absolute_us, stated_us, stated_difference_us, absolute_share,
      difference_share;
  for (int k = 0; k < touches; ++k) {
    const Answer answer = Touch(lease.token(), FromAbove(0.02, k % 4), "touch " + std::to_string(k));
    if (!answer.status.ok()) {
      std::fprintf(stderr, "error: %s\n", answer.status.error_message().c_str());
      return 1;
    }
    const v1::TouchResult& result = answer.response.results(0);
    const rig::TouchTruth truth = emulator_->Touches().back();
    const v1::Measured& measured = result.measured();
    stated_us.push_back(1e6 * measured.synchronisation_uncertainty_s());
    stated_difference_us.push_back(1e6 * measured.time_uncertainty_s());
    for (int i = 0; i < result.contact_time_s_size(); ++i) {
      absolute_us.push_back(1e6 * (result.contact_time_s(i) - truth.reported_s[i]));
      absolute_share.push_back(std::abs(absolute_us.back()) / stated_us.back());
      if (i == 0) continue;
      difference_us.push_back(1e6 * (result.contact_time_s(i) - result.contact_time_s(0) -
                                     (truth.reported_s[i] - truth.reported_s[0])));
      difference_share.push_back(std::abs(difference_us.back()) / stated_difference_us.back());
    }
  }
  const auto print = [](const char* name, const std::vector<double>& errors_us, std::vector<double> shares,
                        std::vector<double> stated) {
    double mean = 0, square = 0;
    std::vector<double> sizes;
    for (const double each : errors_us) {
      mean += each / static_cast<double>(errors_us.size());
      square += each * each / static_cast<double>(errors_us.size());
      sizes.push_back(std::abs(each));
    }
    std::sort(sizes.begin(), sizes.end());
    std::sort(shares.begin(), shares.end());
    std::sort(stated.begin(), stated.end());
    const auto within = [&](double most) {
      return 100.0 *
             static_cast<double>(std::upper_bound(shares.begin(), shares.end(), most) - shares.begin()) /
             static_cast<double>(shares.size());
    };
    std::printf("| %s | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f | %.0f %% | %.0f %% | %.2f |\n", name, mean,
                std::sqrt(std::max(0.0, square - mean * mean)), At(sizes, 0.5), At(sizes, 0.99), sizes.back(),
                At(stated, 0.5), within(1), within(2), shares.back());
  };
  std::printf(
      "emulated rig %g times as fast, 100 ppm, jitter of the line up to 5 ms, %.0f s of warming up, %d "
      "touches; "
      "us of the rig's time\n\n",
      speedup, warm_up_s, touches);
  std::printf(
      "| error against the truth | mean | deviation | median size | 99 %% | most | stated (1 sigma) | within "
      "1 | "
      "within 2 | most over stated |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n");
  print("differences between fingers", difference_us, difference_share, stated_difference_us);
  print("since the approach began", absolute_us, absolute_share, stated_us);
  const v1::RigState state = RigState();
  std::printf(
      "\n%.0f states a second arrived; clocks state %.1f us (controller) and %.1f us (end effector)\n",
      state.arm().rate_hz(), 1e6 * state.arm().clock_uncertainty_s(),
      1e6 * state.effector().clock_uncertainty_s());
  return 0;
}

}  // namespace

int MeasureCpu(double seconds) {
  return Bench().Cpu(seconds);
}

int MeasureStop(int repeats) {
  return Bench().Stop(repeats);
}

int MeasureClock(int touches, double speedup, double warm_up_s) {
  return Bench().Clock(touches, speedup, warm_up_s);
}

}  // namespace touchstone
