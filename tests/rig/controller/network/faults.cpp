#include <cmath>

#include "tests/rig/controller/network/net.h"
#include "tests/rig/world.h"

namespace touchstone::rig {
namespace {

enum class Range { kProbability, kPositive, kFinger, kSwitch, kSigned, kMode };
struct Row {
  const char* name;
  Range range;
  double at_rest;
  bool timed;  // the value is a length in host seconds that runs from when it was set
};
constexpr Row kRows[] = {
    {"drop_bytes", Range::kProbability, 0, false},
    {"corrupt_bytes", Range::kProbability, 0, false},
    {"duplicate_bytes", Range::kProbability, 0, false},
    {"unplug", Range::kPositive, 0, true},
    {"line_delay_ms", Range::kPositive, 0, false},
    {"stuck_finger", Range::kFinger, -1, false},
    {"missing_finger", Range::kFinger, -1, false},
    {"bounce", Range::kSwitch, 0, false},
    {"clock_drift_ppm", Range::kSigned, 0, false},
    {"late_packets_ms", Range::kPositive, 0, false},
    {"skip_packets", Range::kProbability, 0, false},
    {"freeze", Range::kPositive, 0, true},
    {"disconnect", Range::kSwitch, 0, false},
    {"protective_stop", Range::kSwitch, 0, false},
    {"emergency_stop", Range::kSwitch, 0, false},
    {"safety_mode", Range::kMode, 1, false},
    {"power_cut", Range::kPositive, 0, true},
    {"network", Range::kPositive, 0, true},
    {"speed_scaling", Range::kProbability, 1, false},
    {"speed_slider", Range::kProbability, 1, false},
    {"half_turn_longer", Range::kProbability, 0.5, false},
    {"old_software", Range::kSwitch, 0, false},
    {"local_control", Range::kSwitch, 0, false},
    {"stale_frame", Range::kSwitch, 0, false},
    {"camera_unplug", Range::kPositive, 0, true},
    {"finger_stiffness", Range::kPositive, 0.05, false},
    {"force_offset_n", Range::kSigned, 0, false},
};

const Row* Find(const std::string& name) {
  for (const Row& row : kRows)
    if (name == row.name) return &row;
  return nullptr;
}

std::string Complaint(const Row& row, double value) {
  const std::string which = "fault '" + std::string(row.name) + "' = " + std::to_string(value) + ": ";
  if (!std::isfinite(value)) return which + "must be a finite number";
  switch (row.range) {
    case Range::kProbability:
      return value >= 0 && value <= 1 ? "" : which + "must lie between 0 and 1";
    case Range::kPositive:
      return value >= 0 ? "" : which + "must be at least 0";
    case Range::kFinger:
      return value >= -1 && value < 64 && value == std::floor(value)
                 ? ""
                 : which + "must be the index of a finger, or -1 for none";
    case Range::kSwitch:
      return value == 0 || value == 1 ? "" : which + "must be 0 or 1";
    case Range::kMode:
      return value >= 0 && value <= 255 && value == std::floor(value)
                 ? ""
                 : which + "must be a whole number from 0 to 255";
    case Range::kSigned:
      return "";
  }
  return "";
}

}  // namespace

double Faults::HostS() const {
  return clock_ != nullptr ? clock_->HostS() : HostNowS();
}

const std::vector<std::string>& Faults::Names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> made;
    for (const Row& row : kRows) made.push_back(row.name);
    return made;
  }();
  return names;
}

std::string Faults::Set(const std::string& name, double value) {
  const Row* row = Find(name);
  if (!row) {
    std::string known;
    for (const std::string& each : Names()) known += (known.empty() ? "" : ", ") + each;
    return "no fault is named '" + name + "'; there are: " + known;
  }
  if (std::string complaint = Complaint(*row, value); !complaint.empty()) return complaint;
  std::lock_guard<std::mutex> lock(mutex_);
  values_[name] = value;
  if (row->timed) until_host_s_[name] = value > 0 ? HostS() + value : 0;
  return "";
}

double Faults::Get(const std::string& name) const {
  std::lock_guard<std::mutex> lock(mutex_);
  if (const auto found = values_.find(name); found != values_.end()) return found->second;
  const Row* row = Find(name);
  return row ? row->at_rest : 0;
}

double Faults::Take(const std::string& name) {
  std::lock_guard<std::mutex> lock(mutex_);
  const auto found = values_.find(name);
  if (found == values_.end()) return 0;
  const double value = found->second;
  values_.erase(found);
  return value;
}

double Faults::UntilHostS(const std::string& name) const {
  std::lock_guard<std::mutex> lock(mutex_);
  const auto found = until_host_s_.find(name);
  if (found == until_host_s_.end() || found->second <= HostS()) return 0;
  return found->second;
}

}  // namespace touchstone::rig
