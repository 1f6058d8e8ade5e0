// What the emulated controller is without its sockets: the arm, its motions, its safety, its registers and
// its program, on simulated time. Not thread-safe.
#pragma once

#include <array>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "tests/rig/controller.h"
#include "tests/rig/controller/machine/motion.h"
#include "tests/rig/controller/script/kinematics.h"
#include "tests/rig/controller/script/script_machine.h"

namespace touchstone::rig {

enum RobotMode { kBooting = 2, kPowerOff = 3, kPowerOn = 4, kIdle = 5, kRunning = 7 };
// Those that the rest of the emulator names; others can be set as a fault (UR's client library, ur/datatypes.h).
enum SafetyMode {
  kNormal = 1,
  kReduced = 2,
  kProtectiveStop = 3,
  kRecovery = 4,
  kSafeguardStop = 5,
  kSystemEmergencyStop = 6,
  kRobotEmergencyStop = 7,
  kImmiEmergencyStop = 15,
  kProfisafeEmergencyStop = 20,
};
// "PROTECTIVE_STOP"; "" for a number without a name.
std::string SafetyModeName(int mode);
enum RuntimeState { kStopping = 0, kStopped = 1, kPlaying = 2, kPausing = 3, kPaused = 4 };

struct Registers {
  std::array<int32_t, 48> input_int{}, output_int{};
  std::array<double, 48> input_double{}, output_double{};
  std::array<bool, 128> input_bit{}, output_bit{};
};

// A message on the primary and secondary interfaces (the numbers are UR's, of its primary client interface).
struct Announcement {
  enum Kind { kText = 0, kPopup = 2, kError = 6, kKey = 7, kException = 10 };
  Kind kind;
  std::string title, text;
  int first = 0, second = 0;  // code and argument of an error; line and column of an exception
};

// Everything that RTDE and the primary interface tell, at one time of the controller's grid of cycles. "actual" is
// where the target was `following_lag_s` before, with noise.
struct RobotState {
  double timestamp_s = 0;
  Joints target_q, target_qd, target_qdd, actual_q, actual_qd;
  Vector6 target_tcp_pose, target_tcp_speed, actual_tcp_pose, actual_tcp_speed, actual_tcp_force, tcp_offset;
  int robot_mode = 0, safety_mode = 0, runtime_state = 0;
  uint32_t robot_status_bits = 0, safety_status_bits = 0;
  double speed_scaling = 0;          // of the trajectory limiter alone
  double target_speed_fraction = 0;  // the slider; the arm's speed is the commanded one times both
  uint64_t digital_inputs = 0, digital_outputs = 0;
  double payload_kg = 0;
  Eigen::Vector3d payload_cog_m = Eigen::Vector3d::Zero(), elbow_m = Eigen::Vector3d::Zero();
  int script_line = 0;
  bool program_running = false;
  Registers registers;
};

class Machine : public ScriptHost {
 public:
  Machine(const ControllerOptions& options, Faults* faults, TipListener* tip);
  ~Machine() override;

  double cycle_s() const { return cycle_s_; }
  double now_s() const { return now_s_; }
  double CycleAtOrAfter(double time_s) const;

  // Lets everything happen up to then, each thing at its own time. `changed` is called whenever output
  // registers or a mode have changed, at the time when they did.
  void Advance(double now_s, const std::function<void()>& changed);
  // Trips those watchdogs whose input has not come by now: to be called once what has come was taken.
  void CheckWatchdogs(const std::function<void()>& changed);
  // When the next thing happens by itself; infinite if nothing is due.
  double NextEventS() const;
  // A motion or a program that waits for cycles wants to be advanced every control cycle.
  bool NeedsCycles() const;
  double NextCycleS() const;  // of a program that waits for one; infinite if none does
  // Stands still and does nothing, or goes on.
  void Freeze(double now_s);
  void Thaw(double now_s);
  // The controller loses its power, and boots when it comes back: registers, tool and payload are gone, its clock begins
  // anew, and the arm is off.
  void LosePower();
  void Boot(double now_s);

  // Programs. Errors become announcements. Like everything else that the controller does by itself, programs run at
  // the cycles of its clock.
  void StartProgram(const std::string& script);
  bool StopProgram();    // false: none ran
  bool PauseProgram();   // likewise
  bool ResumeProgram();  // false: none was paused
  bool program_running() const { return script_ != nullptr && !paused_; }
  bool has_program() const { return script_ != nullptr; }

  // Dashboard.
  void PowerOn();
  void PowerOff();
  void ReleaseBrakes();
  bool Unlock();  // false: not within 5 s of the stop
  int LaggingSafetyMode() const;
  // Only e-Series controllers know it: what comes from outside may be read, but moves nothing.
  bool LocalControl() const;
  bool OldSoftware() const;  // of before 5.3.0 (3.9.0 on CB3)
  int robot_mode() const { return robot_mode_; }
  int safety_mode() const { return safety_mode_; }

  // RTDE.
  Registers& registers() { return registers_; }
  void InputWritten(const std::string& name);  // feeds the watchdog
  void SetSpeedSlider(double fraction);
  uint32_t slider_mask = 0, digital_output_mask = 0;  // as clients last wrote them
  void SetDigitalOutputs(uint32_t mask, uint32_t values);
  RobotState State();
  std::vector<Announcement> TakeAnnouncements();
  void Announce(Announcement announcement);

  // Of the target, now or up to one motion before; of the arm that follows it.
  Eigen::Isometry3d FlangeAt(double time_s) const;
  Eigen::Isometry3d ActualFlangeAt(double time_s) const {
    return FlangeAt(time_s - options_.following_lag_s);
  }
  const Eigen::Isometry3d& flange_from_tip() const { return flange_from_tip_; }
  // Or about to: a program begins, or goes on after a motion, at the next cycle.
  bool Moving() const;
  uint64_t Count(const std::string& what) const;
  const ArmGeometry& geometry() const { return geometry_; }

  // For the functions of scripts (script_functions.cpp).
  Outcome CallBuiltin(int index, const std::vector<Value>& arguments, int thread) override;
  bool Resting() const override { return motion_ == nullptr; }
  Outcome MoveLine(const Eigen::Isometry3d& base_from_tip, double speed, double acceleration,
                   double duration_s, int thread);
  Outcome MoveJoints(const Joints& joints, double speed, double acceleration, double duration_s, int thread);
  Outcome MoveAlong(const Vector6& twist, double acceleration, double duration_s, int thread);
  Outcome StopMotion(double deceleration);
  void SetTool(const Eigen::Isometry3d& flange_from_tip);
  void RequestProtectiveStop() { protective_stop_asked_ = true; }  // of a program: at the end of this cycle
  // Without a centre of gravity the tool centre point is, now and whenever it is set (UR's script manual, SW 5.x,
  // set_payload). Flange frame.
  void SetPayload(double kg, const std::optional<Eigen::Vector3d>& cog_m);
  void SetPayloadMass(double kg) {
    payload_kg_ = kg;
    ZeroForceSensor();
  }
  // An e-Series also does this whenever a payload is set (UR's script manual SW 10.6, set_target_payload: "The force/torque
  // measurements are automatically zeroed when setting the payload"); a CB3 has no sensor.
  void ZeroForceSensor();
  Eigen::Vector3d PayloadCog() const {
    return payload_cog_m_.value_or(Eigen::Vector3d(flange_from_tip_.translation()));
  }
  double payload_kg() const { return payload_kg_; }
  void SetFreedrive(bool on);
  bool free() const { return free_; }
  bool MoveByHand(const Joints& joints);  // false: it is not free
  bool e_series() const { return options_.model != "ur3"; }
  void SetWatchdog(const std::string& variable, double min_hz, const std::string& action);
  void WriteOutput(int index, int32_t value);
  void WriteOutput(int index, double value);
  void WriteOutput(int index, bool value);
  void SetDigitalOutput(int index, bool on) { SetDigitalOutputs(1u << index, on ? 1u << index : 0); }
  uint64_t digital_inputs() const { return 0; }
  uint64_t digital_outputs() const { return digital_outputs_; }
  Joints JointsAt(double time_s) const;

 private:
  struct Motion;
  struct JointMotion;
  JointMotion TargetAt(double time_s) const;
  Vector6 TipSpeed(const JointMotion& joints) const;
  Outcome Begin(std::unique_ptr<Motion> motion, double speed, double acceleration, double duration_s,
                double first_speed);
  // Empty: the thread may begin a motion now. Otherwise it has to wait.
  bool MustWaitToMove(int thread, bool keeps_going);
  void RequireReady() const;
  bool TakesTheLongerTurn();  // on a line of half a turn
  void FinishMotion(double time_s);
  void Progress(double time_s);
  void Tell(const std::function<void()>& changed);
  void RunScript();
  void EndProgram();
  void Halt();  // brings the arm to rest as fast as it can
  void ProtectiveStop(int code, const std::string& why);
  void EmergencyStop(int mode);
  bool SafetyPermitsMotion() const { return safety_mode_ == kNormal || safety_mode_ == kReduced; }
  // As a safety function does: the program is paused, not ended (README.md), and the arm brakes.
  void PauseForSafety();
  void TakeSafetyMode(int mode);                                             // of a fault
  Eigen::Vector3d ForceOnTip(const Eigen::Isometry3d& base_from_tip) const;  // base frame, before any zeroing
  void LookAtFaults();
  void Rescale();
  double DrivenSpeed(const Motion& motion) const;  // as commanded, times limiter and slider; 0 while paused
  void DriveOn();                                  // the motion goes on at the speed that holds now
  bool OnCycle(double time_s) const;
  double NextScriptS() const;  // when the program wants to go on, beside the cycles that it waits for
  void SetSafety(int mode);
  double NextMotionEventS() const;
  void Later(double seconds, std::function<void()> action);

  ControllerOptions options_;
  Faults* faults_;
  TipListener* tip_;
  ArmGeometry geometry_;
  double cycle_s_;
  double now_s_ = 0;
  std::mt19937_64 random_;

  Joints joints_;
  Eigen::Isometry3d flange_from_tip_ = Eigen::Isometry3d::Identity();
  double payload_kg_ = 0;
  std::optional<Eigen::Vector3d> payload_cog_m_ = Eigen::Vector3d::Zero();
  std::unique_ptr<Motion> motion_, past_;  // past_: the one before, which ended at past_end_s_
  double past_end_s_ = 0;
  uint64_t straight_motions_ = 0;
  double last_progress_s_ = 0;

  int robot_mode_ = kPowerOff, safety_mode_ = kNormal;
  double stopped_at_s_ = -1e9;
  bool emergency_ = false, frozen_ = false;
  int safety_fault_ = kNormal;
  double booted_at_s_ = 0;
  Eigen::Vector3d force_zero_n_ = Eigen::Vector3d::Zero();  // flange frame; what the sensor shows less
  bool free_ = false;  // for a hand, while the program runs that asked for it
  double frozen_at_s_ = 0;
  std::vector<std::pair<double, int>> safety_history_;
  std::vector<std::pair<double, std::function<void()>>> later_;
  double slider_ = 1, slider_fault_ = 1, limiter_ = 1;

  Registers registers_;
  uint64_t digital_outputs_ = 0;
  bool changed_ = false;
  std::vector<Announcement> announcements_;

  std::unique_ptr<ScriptMachine> script_;
  bool protective_stop_asked_ = false;
  bool script_fresh_ = false, in_secondary_ = false, paused_ = false;
  double script_due_s_ = 0;  // the cycle at which it begins, or goes on after a motion
  struct Watchdog {
    std::string variable;
    double period_s;
    enum Action { kIgnore, kPause, kStop } action;
    double fed_s;
  };
  std::vector<Watchdog> watchdogs_;
  uint64_t programs_ = 0, motions_ = 0, protective_stops_ = 0, watchdog_stops_ = 0;
};

// The functions that scripts may call, in the order of their indices.
const std::vector<BuiltinSignature>& Builtins();

}  // namespace touchstone::rig
