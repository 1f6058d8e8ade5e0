// How programs begin, run, are paused and end, and the watchdogs over them.
#include <algorithm>
#include <utility>

#include "tests/rig/controller/machine/machine_motion.h"
#include "tests/rig/controller/never.h"

namespace touchstone::rig {

void Machine::StartProgram(const std::string& script) {
  // Without a word (UniversalRobots/Universal_Robots_ROS_Driver, issue 13).
  if (LocalControl()) return;
  ScriptProgram program;
  try {
    program = Compile(script, Builtins());
  } catch (const CompileError& error) {
    Announce({Announcement::kException, "", error.what(), error.line, error.column});
    return;
  }
  if (robot_mode_ != kRunning || !SafetyPermitsMotion()) {
    Announce({Announcement::kError, "",
              "program '" + program.name + "' was not started: robot mode " + std::to_string(robot_mode_) +
                  ", safety mode " + std::to_string(safety_mode_),
              0, 0});
    return;
  }
  if (program.secondary) {  // beside the running program, without feedback; it must not wait for anything
    ScriptMachine machine(std::move(program), this, cycle_s_);
    in_secondary_ = true;
    machine.Run(now_s_);
    in_secondary_ = false;
    return;
  }
  // The first program that is sent to a paused one only ends it (UniversalRobots/Universal_Robots_Client_Library, issue
  // 123).
  if (script_ && paused_) {
    StopProgram();
    return;
  }
  if (script_) EndProgram();
  ++programs_;
  Announce({Announcement::kKey, "PROGRAM_XXX_STARTED", program.name});
  script_ = std::make_unique<ScriptMachine>(std::move(program), this, cycle_s_);
  script_fresh_ = true;
  script_due_s_ = CycleAtOrAfter(now_s_);
  changed_ = true;
}

bool Machine::StopProgram() {
  const bool was_running = script_ != nullptr;
  if (script_) EndProgram();
  Halt();
  return was_running;
}

bool Machine::PauseProgram() {
  if (!script_ || paused_) return false;
  paused_ = changed_ = true;
  DriveOn();
  return true;
}

bool Machine::ResumeProgram() {
  if (!script_ || !paused_ || !SafetyPermitsMotion()) return false;
  paused_ = false;
  changed_ = true;
  script_due_s_ = CycleAtOrAfter(now_s_);
  for (Watchdog& watchdog : watchdogs_) watchdog.fed_s = now_s_;
  DriveOn();
  return true;
}

void Machine::RunScript() {
  if (!script_ || paused_) return;
  script_fresh_ = false;
  const bool goes_on = script_->Run(now_s_);
  // A motion whose thread has ended belongs to nobody; unless stopl has taken it over, it ends now.
  if (motion_ && motion_->thread >= 0 && !script_->Lives(motion_->thread)) motion_->thread = -1;
  if (std::exchange(protective_stop_asked_, false)) {
    ProtectiveStop(0, "the program asked for it");
    return;
  }
  if (!goes_on) {
    if (const auto& failure = script_->failure())
      Announce({Announcement::kException, "", failure->what, failure->line, failure->column});
    EndProgram();
  }
  if (motion_ && motion_->thread < 0) Halt();
}

void Machine::EndProgram() {
  Announce({Announcement::kKey, "PROGRAM_XXX_STOPPED", script_->program().name});
  script_.reset();
  watchdogs_.clear();
  free_ = false;
  paused_ = false;
  if (motion_) motion_->thread = -1;
  changed_ = true;
}

double Machine::NextScriptS() const {
  if (!script_ || paused_) return kNever;
  double next = script_->NextWakeS();
  if (script_fresh_ || (!motion_ && script_->WaitsForRest())) next = std::min(next, script_due_s_);
  next = std::max(next, now_s_);
  return next < kNever ? std::max(CycleAtOrAfter(next), next) : kNever;
}

double Machine::NextCycleS() const {
  return script_ && !frozen_ ? script_->NextCycleS() : kNever;
}

void Machine::CheckWatchdogs(const std::function<void()>& changed) {
  if (frozen_ || !script_ || paused_) return;
  for (const Watchdog& watchdog : watchdogs_) {
    if (watchdog.action == Watchdog::kIgnore || now_s_ - watchdog.fed_s < watchdog.period_s) continue;
    ++watchdog_stops_;
    Announce({Announcement::kText, "", "RTDE watchdog: '" + watchdog.variable + "' was not updated in time"});
    // UR's script manual (SW 5.19, rtde_set_watchdog): "ignore", "pause" or "stop" the program. The safety system has
    // no part in it, and a program that ends takes its watchdogs with it.
    if (watchdog.action == Watchdog::kStop)
      StopProgram();
    else
      PauseProgram();
    break;
  }
  Tell(changed);
}

void Machine::InputWritten(const std::string& name) {
  for (Watchdog& watchdog : watchdogs_)
    if (watchdog.variable == name) watchdog.fed_s = now_s_;
}

void Machine::SetWatchdog(const std::string& variable, double min_hz, const std::string& action) {
  watchdogs_.erase(std::remove_if(watchdogs_.begin(), watchdogs_.end(),
                                  [&](const Watchdog& watchdog) { return watchdog.variable == variable; }),
                   watchdogs_.end());
  const auto what = action == "stop"    ? Watchdog::kStop
                    : action == "pause" ? Watchdog::kPause
                                        : Watchdog::kIgnore;
  if (min_hz > 0) watchdogs_.push_back({variable, 1 / min_hz, what, now_s_});
}

}  // namespace touchstone::rig
