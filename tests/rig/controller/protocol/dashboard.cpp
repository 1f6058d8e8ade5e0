#include "tests/rig/controller/protocol/dashboard.h"

#include <algorithm>
#include <cctype>
#include <set>

namespace touchstone::rig {
namespace {

std::string ModeName(int mode) {
  switch (mode) {
    case kBooting:
      return "BOOTING";
    case kPowerOff:
      return "POWER_OFF";
    case kPowerOn:
      return "POWER_ON";
    case kIdle:
      return "IDLE";
    case kRunning:
      return "RUNNING";
  }
  return "NO_CONTROLLER";
}

std::string SafetyName(int mode, bool status) {
  const std::string name = SafetyModeName(mode);
  return !name.empty() ? name : status ? "UNDEFINED" : "FAULT";
}

bool StartsWith(const std::string& text, const std::string& with) {
  return text.compare(0, with.size(), with) == 0;
}

}  // namespace

std::string AnswerDashboard(const std::string& line, const std::string& model, bool local, Machine* machine,
                            bool* quit) {
  std::string command = line;
  while (!command.empty() && std::isspace(static_cast<unsigned char>(command.back()))) command.pop_back();
  std::string lower = command;
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
  const bool e_series = model == "ur3e";

  if (lower == "robotmode") return "Robotmode: " + ModeName(machine->robot_mode());
  if (lower == "safetymode") return "Safetymode: " + SafetyName(machine->LaggingSafetyMode(), false);
  if (lower == "safetystatus") return "Safetystatus: " + SafetyName(machine->LaggingSafetyMode(), true);
  // In local control an e-Series answers so to what does more than tell (UniversalRobots/Universal_Robots_ROS_Driver,
  // issues 125 and 262, which also say that a connection from before stays refused). Which commands it refuses UR does
  // not list; here all that change something.
  static const std::set<std::string> kRemoteOnly = {
      "power on", "power off", "brake release", "play",
      "pause",    "stop",      "shutdown",      "unlock protective stop"};
  if (e_series && (local || machine->LocalControl()) &&
      (kRemoteOnly.count(lower) > 0 || StartsWith(lower, "load ")))
    return "Command is not allowed due to safety reasons, please switch robot to Remote Control mode and "
           "reconnect to "
           "port 29999";
  if (lower == "power on") {
    machine->PowerOn();
    return "Powering on";
  }
  if (lower == "power off") {
    machine->PowerOff();
    return "Powering off";
  }
  if (lower == "brake release") {
    machine->ReleaseBrakes();
    return "Brake releasing";
  }
  // No program was ever loaded on this controller: play only resumes a program that was paused.
  if (lower == "play") return machine->ResumeProgram() ? "Starting program" : "Failed to execute: play";
  if (lower == "pause") return machine->PauseProgram() ? "Pausing program" : "Failed to execute: pause";
  // UR's table of dashboard commands (article 15690): "Stopped", on failure "Failed to execute: stop".
  if (lower == "stop") return machine->StopProgram() ? "Stopped" : "Failed to execute: stop";
  if (lower == "running")
    return std::string("Program running: ") + (machine->program_running() ? "true" : "false");
  if (lower == "programstate") return "STOPPED";
  if (lower == "get loaded program") return "No program loaded";
  if (StartsWith(lower, "load ")) return "File not found: " + command.substr(5);
  if (lower == "unlock protective stop") {
    if (machine->Unlock()) return "Protective stop releasing";
    return "Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective stop "
           "before "
           "unlocking";
  }
  if (lower == "close popup") return "closing popup";
  if (lower == "close safety popup") return "closing safety popup";
  if (StartsWith(lower, "popup ")) return "showing popup";
  if (StartsWith(lower, "addtolog ")) return "Added log message";
  if (lower == "polyscopeversion")
    return e_series ? "URSoftware 5.11.0.108249 (Sep 01 2021)" : "URSoftware 3.15.8.106339 (Jun 20 2022)";
  if (lower == "get robot model") return "UR3";
  if (lower == "get serial number") return e_series ? "20200300000" : "2014300000";
  if (e_series && lower == "is in remote control") return machine->LocalControl() ? "false" : "true";
  if (lower == "quit") {
    *quit = true;
    return "Disconnected";
  }
  return "could not understand: '" + command + "'";
}

}  // namespace touchstone::rig
