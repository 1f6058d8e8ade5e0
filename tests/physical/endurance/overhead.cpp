// The gateway's own time in a touch: what passes between what it hears and what it says, while the rig waits.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "server/base/threads/thread_pool.h"
#include "server/gateway/arm/ur_arm.h"
#include "server/gateway/arm/ur_modes.h"
#include "server/gateway/rig/rig.h"
#include "server/service/core/convert.h"
#include "server/service/core/resources.h"
#include "server/service/gateway/gateway_options.h"
#include "server/session/journal/command_bytes.h"
#include "tests/physical/endurance/measure.h"
#include "tests/physical/endurance/stamped_parts.h"
#include "tests/physical/physical_test.h"

namespace touchstone {
namespace {

class Overhead : public PhysicalTest {
 public:
  int Measure(int touches, double speedup);

 private:
  void TestBody() override {}
  absl::Status Open();
  absl::StatusOr<double> FirstHeardS(const gateway::arm::ArmState& last,
                                     gateway::arm::MotionPhase phase) const;

  Stamps stamps_;
  std::unique_ptr<gateway::Rig> made_rig_;
  geometry::Bounds bounds_;
};

// As the gateway puts its rig together, with stamps between the parts.
absl::Status Overhead::Open() {
  const std::string config = emulator_->config_path();
  const char* argv[] = {"touchstone-gateway", "--config", config.c_str(), "--supershape-triangles", "2000"};
  auto flags = service::ParseGatewayFlags(5, argv);
  if (!flags.ok()) return flags.status();
  const service::GatewayOptions& options = flags->options;
  ThreadPool pool(0);
  auto objects = source::ObjectStore::Load(options.common.meshes, options.common.supershape_triangles, &pool);
  if (!objects.ok()) return objects.status();
  auto object = objects->Find("lat00", "object");
  if (!object.ok()) return object.status();
  bounds_ = (*object)->surface->bounds();

  gateway::RigParts parts;
  parts.changes = std::make_unique<gateway::timing::ChangeNotifier>();
  auto calibration = gateway::calibration::ReadCalibration(options.calibration);
  if (!calibration.ok()) return calibration.status();
  auto planner = gateway::arm::MotionPlanner::Create(options.arm.model, options.limits, *calibration);
  if (!planner.ok()) return planner.status();
  parts.planner = *std::move(planner);
  auto journal = session::Journal::Open(options.journal, session::Journal::Mode::kCreateOrReadWrite);
  if (!journal.ok()) return journal.status();
  parts.journal = std::make_unique<StampedJournal>(*std::move(journal), &stamps_);
  auto audit = gateway::audit::AuditLog::Open(options.audit_log);
  if (!audit.ok()) return audit.status();
  parts.audit = *std::move(audit);
  gateway::arm::UrArmOptions arm;
  arm.model = options.arm.model, arm.address = options.arm.address;
  arm.dashboard_port = options.arm.dashboard_port, arm.primary_port = options.arm.primary_port;
  arm.secondary_port = options.arm.secondary_port, arm.rtde_port = options.arm.rtde_port;
  arm.script.flange_from_tip = calibration->flange_from_tip;
  arm.script.payload_kg = options.limits.payload_kg;
  arm.script.payload_cog_m = options.limits.payload_cog_m;
  arm.script.transit_speed_m_s = options.limits.transit_speed_m_s;
  arm.script.acceleration_m_s2 = options.limits.acceleration_m_s2;
  arm.script.time_scale = options.time_scale;
  auto connected = gateway::arm::ConnectUrArm(arm, parts.changes.get());
  if (!connected.ok()) return connected.status();
  parts.arm = std::make_unique<StampedArm>(*std::move(connected), &stamps_);
  auto effector = gateway::effector::Effector::Open(options.effector, parts.changes.get());
  if (!effector.ok()) return effector.status();
  const int fingers = static_cast<int>(options.effector.fingers.size());
  parts.effector = std::make_unique<StampedEffector>(*std::move(effector), fingers, &stamps_);
  gateway::RigOptions rig;
  rig.fingers = fingers;
  rig.time_scale = options.time_scale;
  rig.max_overtravel_m = options.max_overtravel_mm / 1000;
  rig.mount_command = options.mount_command;
  auto made = gateway::Rig::Create(std::move(rig), std::move(parts));
  if (!made.ok()) return made.status();
  made_rig_ = *std::move(made);
  return absl::OkStatus();
}

// Host time at which the first state of this program with this phase arrived.
absl::StatusOr<double> Overhead::FirstHeardS(const gateway::arm::ArmState& last,
                                             gateway::arm::MotionPhase phase) const {
  for (const gateway::arm::ArmState& state :
       made_rig_->arm().History(last.controller_time_s - 29, last.controller_time_s))
    if (state.program_id == last.program_id && state.phase == phase) return state.host_time_s;
  return absl::NotFoundError(std::string("no state has the phase ") + gateway::arm::PhaseName(phase));
}

// How long the disk itself takes for one: a page appended to a file in that folder, then fdatasync.
std::vector<double> SyncTimesS(const std::string& folder) {
  const std::string path = folder + "/sync";
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
  const std::string page(4096, 'x');
  std::vector<double> times_s;
  for (int k = 0; k < 50 && file >= 0; ++k) {
    const double began_s = gateway::timing::HostNowS();
    if (write(file, page.data(), page.size()) < 0 || fdatasync(file) != 0) break;
    times_s.push_back(gateway::timing::HostNowS() - began_s);
  }
  if (file >= 0) close(file);
  unlink(path.c_str());
  return times_s;
}

void PrintRow(const char* name, std::vector<double> times_s) {
  std::sort(times_s.begin(), times_s.end());
  const auto at = [&](double share) {
    return 1e3 * times_s[static_cast<size_t>(std::lround(share * static_cast<double>(times_s.size() - 1)))];
  };
  std::printf("| %-62s | %7.3f | %7.3f | %7.3f |\n", name, at(0.5), at(0.99), at(1));
}

int Overhead::Measure(int touches, double speedup) {
  StartRig([&](rig::EmulatorOptions* options) { options->speedup = speedup; });
  if (const absl::Status opened = Open(); !opened.ok()) {
    std::fprintf(stderr, "error: %s\n", std::string(opened.message()).c_str());
    return 1;
  }
  WaitUntil([this] { return made_rig_->State() == source::SourceState::kIdle; }, "the rig is ready");
  std::vector<double> before_s, go_s, retreat_s, after_s, all_s, disk_s, answers_s, wall_s;
  for (int k = -2; k < touches; ++k) {  // the first two mount the object and are not counted
    const v1::CommandedTouch message = FromAbove(0.02 + 1e-5 * k, k % 4);
    source::TouchCommand command;
    command.session = "overhead", command.id = std::to_string(k), command.object = "lat00",
    command.bounds = bounds_;
    command.touch = *service::FromProto(message, "touch");
    command.bytes = session::CommandBytes(message);
    stamps_ = Stamps();
    const double began_s = gateway::timing::HostNowS();
    const auto made = made_rig_->Touch(command, [] { return absl::OkStatus(); });
    const double ended_s = gateway::timing::HostNowS();
    const auto last = made_rig_->arm().State();
    if (!made.ok() || !last.ok()) {
      std::fprintf(stderr, "error: %s\n",
                   std::string((made.ok() ? last.status() : made.status()).message()).c_str());
      return 1;
    }
    const auto ready = FirstHeardS(*last, gateway::arm::MotionPhase::kReady),
               done = FirstHeardS(*last, gateway::arm::MotionPhase::kDone);
    if (!ready.ok() || !done.ok() || stamps_.all_heard_s == 0 || k < 0) continue;
    wall_s.push_back(ended_s - began_s);
    before_s.push_back(stamps_.program_sent_s - began_s - stamps_.disk_before_s);
    go_s.push_back(stamps_.go_sent_s - *ready - stamps_.effector_arm_s);
    retreat_s.push_back(stamps_.retract_sent_s - stamps_.all_heard_s);
    after_s.push_back(ended_s - *done - stamps_.effector_disarm_s - (stamps_.disk_s - stamps_.disk_before_s));
    all_s.push_back(before_s.back() + go_s.back() + retreat_s.back() + after_s.back());
    disk_s.push_back(stamps_.disk_s);
    answers_s.push_back(stamps_.effector_arm_s + stamps_.effector_disarm_s);
  }
  if (all_s.empty()) return 1;
  std::printf("%zu touches, emulated rig %g times as fast, %.0f states a second; ms\n\n", all_s.size(),
              speedup, speedup * made_rig_->arm().StateRateHz());
  std::printf("| %-62s | %7s | %7s | %7s |\n| --- | --- | --- | --- |\n", "", "median", "99 %", "most");
  PrintRow("asked until the program is on the wire (checks, planning)", before_s);
  PrintRow("at the start until go is on the wire", go_s);
  PrintRow("last contact known until retreat is on the wire", retreat_s);
  PrintRow("back at the start until answered (result)", after_s);
  PrintRow("**the gateway's own time, together**", all_s);
  PrintRow("besides: the journal's disk (2 commits)", disk_s);
  if (const std::vector<double> sync_s = SyncTimesS(folder_.Path("rig")); !sync_s.empty())
    PrintRow("for comparison: one page and fdatasync, 50 times", sync_s);
  PrintRow("besides: the end effector's answers to arm and disarm", answers_s);
  PrintRow("a touch in all, host time", wall_s);
  made_rig_ = nullptr;
  return 0;
}

}  // namespace

int MeasureOverhead(int touches, double speedup) {
  return Overhead().Measure(touches, speedup);
}

}  // namespace touchstone
