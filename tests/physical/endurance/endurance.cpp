#include "tests/physical/endurance/endurance.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

namespace touchstone {
namespace {

constexpr int kMaxAttempts = 40;
const std::string kIdPrefix = "touch ";
constexpr uint64_t kCompareEvery = 500;  // the emulator keeps 10,000 touches
constexpr double kLikenessS = 2e-3;  // as far as a result's differences may lie from those of its own touch

double NowS() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void SleepS(double s) {
  std::this_thread::sleep_for(std::chrono::duration<double>(s));
}

double ResidentMb(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/statm");
  double all = 0, resident = 0;
  file >> all >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

Eigen::Vector3d StartOf(const v1::CommandedTouch& touch) {
  return {touch.target_m().x() - touch.standoff_m() * touch.approach().x(),
          touch.target_m().y() - touch.standoff_m() * touch.approach().y(),
          touch.target_m().z() - touch.standoff_m() * touch.approach().z()};
}

// Differences from the first finger that reported; how far they lie from the truth's. Infinite
// if others reported.
double FurthestS(const std::vector<double>& contact_time_s, const std::vector<double>& truth_s) {
  if (contact_time_s.size() != truth_s.size()) return INFINITY;
  size_t first = 0;
  while (first < truth_s.size() && std::isnan(truth_s[first])) ++first;
  double furthest_s = 0;
  for (size_t i = 0; i < truth_s.size(); ++i) {
    if (std::isnan(contact_time_s[i]) != std::isnan(truth_s[i])) return INFINITY;
    if (std::isnan(truth_s[i])) continue;
    furthest_s = std::max(
        furthest_s, std::abs((contact_time_s[i] - contact_time_s[first]) - (truth_s[i] - truth_s[first])));
  }
  return furthest_s;
}

bool SameNumbers(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](double x, double y) {
           return x == y || (std::isnan(x) && std::isnan(y));
         });
}

std::vector<double> TimesOf(const v1::TouchResult& result) {
  return {result.contact_time_s().begin(), result.contact_time_s().end()};
}

}  // namespace

std::string EnduranceReport::Text() const {
  std::ostringstream text;
  if (before > 0) text << before << " touches of earlier runs; then ";
  text << done << " touches done in " << host_s << " s (" << done / std::max(host_s, 1e-9) << "/s), "
       << attempts << " attempts, " << failed << " of them failed; " << made << " emulated touches\n"
       << "never done " << never << ", wrong " << wrong << ", changed when asked again " << changed << " of "
       << repeats << ", lost " << lost << ", doubled " << doubled << ", unfinished " << unfinished << "\n"
       << "worst difference from the truth " << worst_difference_s * 1e6 << " us\n"
       << "resident memory, MB: gateway " << gateway_rss_tenth_mb << " after a tenth, " << gateway_rss_end_mb
       << " at the end; emulator and client " << own_rss_tenth_mb << ", " << own_rss_end_mb << "\nfaults:";
  for (const auto& [name, count] : faults) text << " " << name << " " << count;
  text << "\n";
  for (const auto& [what, count] : failures) text << "  " << count << " x " << what << "\n";
  for (const std::string& remark : remarks) text << "REMARK " << remark << "\n";
  return text.str();
}

void Endurance::Remark(const std::string& text) {
  if (report_.remarks.size() < 20) report_.remarks.push_back(text);
}

void Endurance::StartServing() {
  options_.own_process ? StartGatewayProcess() : StartGateway();
}

void Endurance::NewLease() {
  lease_ = nullptr;
  lease_ = std::make_unique<KeptLease>(control_.get(), "endurance", true);
}

v1::CommandedTouch Endurance::Command(uint64_t k) {
  // No two of those that are compared with each other have the same speed.
  v1::CommandedTouch touch = FromAbove(0.02 + 1e-6 * static_cast<double>(k % 10'000));
  touch.mutable_target_m()->set_x(std::round(Uniform(-20'000, 20'000)) * 1e-6);
  touch.mutable_target_m()->set_y(std::round(Uniform(-15'000, 15'000)) * 1e-6);
  return touch;
}

void Endurance::Recover() {
  const double until_s = NowS() + 60;
  while (NowS() < until_s) {
    const v1::SourceState state = State();
    if (state == v1::SOURCE_STATE_IDLE || state == v1::SOURCE_STATE_BUSY) break;
    if (state == v1::SOURCE_STATE_PROTECTIVE_STOP) UnlockByHand();
    if (state == v1::SOURCE_STATE_STOPPED) Reset();
    SleepS(0.002);
  }
  NewLease();
}

PhysicalTest::Answer Endurance::Broken(const v1::CommandedTouch& command, const std::string& id) {
  static const std::vector<std::string> kFaults = {
      "drop_bytes", "corrupt_bytes", "duplicate_bytes", "unplug",        "reset",
      "freeze",     "disconnect",    "protective_stop", "stop",          "lease_taken",
      "lease_lost", "stuck_finger",  "hang_up",         "gateway_killed"};
  std::string fault = kFaults[random_() % kFaults.size()];
  // What takes seconds of the host's happens less often.
  const bool slow = fault == "gateway_killed" || fault == "lease_lost" || fault == "freeze";
  if ((slow && Uniform(0, 1) > 0.2) || (fault == "gateway_killed" && !options_.own_process))
    fault = "disconnect";
  ++report_.faults[fault];
  rig::Faults& faults = emulator_->faults();
  const bool noise = fault == "drop_bytes" || fault == "corrupt_bytes" || fault == "duplicate_bytes";
  if (noise) faults.Set(fault, std::pow(10, Uniform(-3.5, -1.5)));
  if (fault == "stuck_finger") faults.Set(fault, static_cast<double>(random_() % 3));
  if (fault == "lease_lost") lease_->StopRenewing();

  auto context = std::make_shared<grpc::ClientContext>();
  const std::string token = lease_->token();
  auto call = std::async(std::launch::async, [this, context, token, command, id] {
    v1::TouchRequest request;
    request.set_object("lat00");
    *request.add_touches() = command;
    request.set_lease_token(token);
    request.set_session("test");
    request.add_touch_ids(id);
    Answer answer;
    answer.status = source_->Touch(context.get(), request, &answer.response);
    return answer;
  });
  SleepS(Uniform(0, 1.2 * usual_s_));
  if (fault == "lease_lost") lease_clock_.Advance(2 * lease_->window_s());
  if (fault == "unplug") faults.Set(fault, Uniform(0.005, 0.1));
  if (fault == "reset") emulator_->Tell("reset");
  if (fault == "freeze") faults.Set(fault, Uniform(0.05, 0.8));
  if (fault == "disconnect" || fault == "protective_stop") faults.Set(fault, 1);
  if (fault == "hang_up") context->TryCancel();
  if (fault == "stop") {
    grpc::ClientContext stopping;
    v1::StopResponse response;
    if (!control_->Stop(&stopping, {}, &response).ok()) Remark(id + ": stop was refused");
  }
  if (fault == "lease_taken") KeptLease other(control_.get(), "another", true);
  if (fault == "gateway_killed") KillGatewayProcess();
  Answer answer = call.get();
  if (noise) faults.Set(fault, 0);
  if (fault == "stuck_finger") faults.Set(fault, -1);
  if (fault == "gateway_killed") {
    lease_ = nullptr;
    StartServing();
  }
  Recover();
  return answer;
}

void Endurance::MakeTouch(uint64_t k) {
  const v1::CommandedTouch command = Command(k);
  const std::string id = kIdPrefix + std::to_string(k);
  for (int attempt = 0; attempt < kMaxAttempts; ++attempt) {
    ++report_.attempts;
    Answer answer;
    if (Uniform(0, 1) < options_.fault_share) {
      answer = Broken(command, id);
    } else {
      const double began_s = NowS();
      answer = Touch(lease_->token(), command, id);
      if (answer.status.ok()) usual_s_ = 0.9 * usual_s_ + 0.1 * (NowS() - began_s);
      if (!answer.status.ok()) Recover();
    }
    if (!answer.status.ok()) {
      ++report_.failed;
      ++report_.failures[std::to_string(answer.status.error_code()) + " " +
                         answer.status.error_message().substr(0, 60)];
      // What a fault has taken away needs its time to come back, on a busy machine more.
      SleepS(0.01 * (1 << std::min(attempt, 7)));
      continue;
    }
    ++report_.done;
    const std::vector<double> times_s = TimesOf(answer.response.results(0));
    pending_.push_back({id, command, times_s});
    answered_s_[id] = times_s;
    if (Uniform(0, 1) >= options_.repeated_share) return;
    ++report_.repeats;
    const uint64_t programs = emulator_->controller().Count("programs");
    const Answer again = Touch(lease_->token(), command, id);
    if (!again.status.ok()) return Recover();  // a lease that ran out on a busy machine
    if (again.response.SerializeAsString() != answer.response.SerializeAsString() ||
        emulator_->controller().Count("programs") != programs) {
      ++report_.changed;
      Remark(id + " was answered differently, or moved, when it was asked for once more");
    }
    return;
  }
  ++report_.never;
  Remark(id + " was never done");
}

void Endurance::CompareWithTruth() {
  const std::vector<rig::TouchTruth> truths = emulator_->Touches();
  std::set<uint64_t> taken;
  for (const Expected& expected : pending_) {
    const rig::TouchTruth* own = nullptr;
    std::string others;  // which fingers reported in touches at its pose
    double nearest_s = INFINITY;
    for (const rig::TouchTruth& truth : truths) {
      if (truth.number <= compared_ || taken.count(truth.number) > 0) continue;
      if (std::abs(truth.speed_m_s - expected.command.speed_m_s()) > 1e-7) continue;
      if ((StartOf(expected.command) - truth.start_in_object_m).norm() > 1e-4) continue;
      others += " (";
      for (const double each : truth.reported_s) others += std::isnan(each) ? "-" : "x";
      others += ")";
      const double furthest_s = FurthestS(expected.contact_time_s, truth.reported_s);
      if (furthest_s < nearest_s) nearest_s = furthest_s, own = &truth;
    }
    if (own == nullptr || nearest_s > kLikenessS) {
      ++report_.wrong;
      std::string fingers;
      for (const double each : expected.contact_time_s) fingers += std::isnan(each) ? "-" : "x";
      Remark(expected.id + ", fingers " + fingers + ": " +
             (own != nullptr   ? "its times are " + std::to_string(nearest_s * 1e6) + " us off"
              : others.empty() ? "no emulated touch was made at its pose"
                               : "in the emulated touches at its pose other fingers reported:" + others));
      continue;
    }
    taken.insert(own->number);
    report_.worst_difference_s = std::max(report_.worst_difference_s, nearest_s);
  }
  pending_.clear();
  if (!truths.empty()) compared_ = std::max(compared_, truths.back().number);
}

void Endurance::CompareWithJournal() {
  const auto journal = session::Journal::Open(folder_.Path("rig/rig.db"), session::Journal::Mode::kReadOnly);
  if (!journal.ok()) return Remark(std::string(journal.status().message()));
  std::set<std::string> seen;
  const absl::Status read = (*journal)->ForEachTouch("test", [&](const session::JournalTouch& touch) {
    if (touch.stage != session::TouchStage::kDone && touch.stage != session::TouchStage::kFailed) {
      ++report_.unfinished;
      Remark(touch.id + " is neither done nor given up");
    }
    if (touch.stage != session::TouchStage::kDone) return true;
    const auto answered = answered_s_.find(touch.id);
    if (!seen.insert(touch.id).second || answered == answered_s_.end()) {
      ++report_.doubled;
      Remark(touch.id + " stands in the journal twice, or was never answered");
      return true;
    }
    std::vector<double> times_s;
    for (const session::JournalFinger& finger : touch.result.fingers)
      times_s.push_back(finger.contact_time_s);
    if (!SameNumbers(times_s, answered->second)) {
      ++report_.lost;
      Remark(touch.id + ": the journal holds another result than the client got");
    }
    return true;
  });
  if (!read.ok()) Remark(std::string(read.message()));
  report_.lost += answered_s_.size() - std::min(answered_s_.size(), seen.size());
}

void Endurance::TakeUpJournal() {
  if (options_.journal.empty() || !std::filesystem::exists(options_.journal)) return;
  const std::string path = folder_.Path("rig/rig.db");
  std::filesystem::create_directories(folder_.Path("rig"));
  std::filesystem::copy_file(options_.journal, path);
  const auto journal = session::Journal::Open(path, session::Journal::Mode::kReadWrite);
  if (!journal.ok()) return Remark(std::string(journal.status().message()));
  const absl::Status read = (*journal)->ForEachTouch("test", [&](const session::JournalTouch& touch) {
    first_ = std::max<uint64_t>(first_, std::strtoull(touch.id.c_str() + kIdPrefix.size(), nullptr, 10) + 1);
    if (touch.stage != session::TouchStage::kDone) return true;
    std::vector<double>& times_s = answered_s_[touch.id];
    for (const session::JournalFinger& finger : touch.result.fingers)
      times_s.push_back(finger.contact_time_s);
    return true;
  });
  // On the new emulator's fixture lies nothing.
  const absl::Status empty = (*journal)->SetMetadata({{"mounted_object", ""}, {"mounted_placement", ""}});
  if (!read.ok() || !empty.ok()) Remark(std::string((read.ok() ? empty : read).message()));
  report_.before = answered_s_.size();
}

void Endurance::LeaveJournal() {
  if (options_.journal.empty()) return;
  const std::string path = folder_.Path("rig/rig.db");
  // Opened and closed, what stands in its log is in the file itself.
  const absl::Status whole = session::Journal::Open(path, session::Journal::Mode::kReadWrite).status();
  if (!whole.ok()) return Remark(std::string(whole.message()));
  std::filesystem::copy_file(path, options_.journal, std::filesystem::copy_options::overwrite_existing);
}

void Endurance::NoteMemory(double* gateway_mb, double* own_mb) const {
  *own_mb = ResidentMb(getpid());
  *gateway_mb = options_.own_process ? ResidentMb(gateway_process()) : *own_mb;
}

EnduranceReport Endurance::Run(const std::function<void(const EnduranceReport&)>& progress) {
  TakeUpJournal();
  StartRig([this](rig::EmulatorOptions* options) {
    options->speedup = options_.speedup;
    options->seed = options_.seed;
    options->drift_ppm = 100;
  });
  StartServing();
  NewLease();
  const double began_s = NowS();
  for (uint64_t k = 0; k < options_.touches; ++k) {
    MakeTouch(first_ + k);
    const bool last = k + 1 == options_.touches;
    if ((k + 1) % kCompareEvery == 0 || last) {
      CompareWithTruth();
      report_.host_s = NowS() - began_s;
      report_.made = emulator_->touches();
      NoteMemory(&report_.gateway_rss_end_mb, &report_.own_rss_end_mb);
      if (progress) progress(report_);
    }
    if (k + 1 == std::max<uint64_t>(1, options_.touches / 10))
      NoteMemory(&report_.gateway_rss_tenth_mb, &report_.own_rss_tenth_mb);
  }
  lease_ = nullptr;
  options_.own_process ? KillGatewayProcess() : StopGateway();
  CompareWithJournal();
  LeaveJournal();
  return report_;
}

}  // namespace touchstone
