// What the desk looks at, and what every page sees of it.
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "client/source/plans/rig_words.h"
#include "client/workbench_server/rig/rig_desk.h"
#include "server/base/status.h"
#include "server/base/units.h"

namespace touchstone::workbench {
namespace {

using nlohmann::json;

constexpr std::chrono::milliseconds kLookEvery{100};
constexpr std::chrono::seconds kLookAnswer{1};
constexpr int kLooksPerBeat = 10;  // a page that hears nothing for longer has lost the workbench

json RigJson(const v1::State& state, const v1::RigState& rig) {
  json pressed = json::array();
  for (const bool finger : rig.effector().pressed()) pressed.push_back(finger);
  const v1::Vector3& tip = rig.arm().base_from_tip().position_m();
  const auto tenths_mm = [](double m) { return std::round(m * kMillimetresPerMetre * 10) / 10; };
  return {{"answers", true},
          {"state", client::SourceStateWord(state.state())},
          {"stop_reason", state.stop_reason()},
          {"lease_holder", state.lease_holder()},
          {"moving", state.running_requests() > 0},
          {"object", rig.object()},
          {"up_face", client::UpFaceWord(rig.up_face())},
          {"mounts_itself", rig.mounts_itself()},
          {"arm", rig.arm().connected()
                      ? absl::StrCat(rig.arm().model(), ", ", client::RobotModeWord(rig.arm().robot_mode()),
                                     ", safety ", client::SafetyModeWord(rig.arm().safety_mode()))
                      : std::string("not connected")},
          {"powered", rig.arm().robot_mode() == v1::ROBOT_MODE_RUNNING},
          {"phase", client::MotionPhaseWord(rig.arm().phase())},
          {"tip_mm", {tenths_mm(tip.x()), tenths_mm(tip.y()), tenths_mm(tip.z())}},
          {"effector", rig.effector().connected() ? "connected" : "not connected"},
          {"pressed", pressed},
          {"last_error", rig.last_error()},
          {"emulated", rig.emulated()},
          {"safety_notice", rig.safety_notice()},
          {"fingers", rig.fingers()},
          {"spacing_m", rig.spacing_m()},
          {"max_speed_mm_s", FromSi(Unit::kMillimetrePerSecond, rig.limits().max_speed_m_s())},
          {"min_speed_mm_s", FromSi(Unit::kMillimetrePerSecond, rig.limits().min_speed_m_s())}};
}

}  // namespace

json RigDesk::LookAtRig() {
  const auto until = std::chrono::system_clock::now() + kLookAnswer;
  grpc::ClientContext first, second;
  first.set_deadline(until);
  second.set_deadline(until);
  v1::State state;
  v1::RigState rig;
  absl::Status status = client::FromGrpc(control_->GetState(&first, v1::GetStateRequest(), &state));
  if (status.ok()) status = client::FromGrpc(state_->GetRig(&second, v1::GetRigRequest(), &rig));
  if (status.ok()) return RigJson(state, rig);
  return {{"answers", false}, {"state", "disconnected"}, {"last_error", std::string(status.message())}};
}

// Looks at the rig while a page watches or something is under way.
void RigDesk::Look() {
  std::unique_lock<std::mutex> lock(mutex_);
  for (int looks = 0; !ending_; ++looks) {
    changed_.wait(lock, [this] {
      return ending_ || !job_.name.empty() || source_ != nullptr || watchers_->count() > 0;
    });
    if (ending_) return;
    lock.unlock();
    json now = LookAtRig();
    lock.lock();
    const bool news = now != rig_json_ || looks % kLooksPerBeat == 0;
    if (now.value("answers", false)) moving_ = now.value("moving", false);
    if (news) {
      ++beat_;
      rig_json_ = std::move(now);
    }
    // The lease is gone: so is control.
    if (source_ != nullptr && job_.name.empty() && !source_->lease()->status().ok()) {
      const std::string why(source_->lease()->status().message());
      BeginJob("the lease was lost", false, [this, why] {
        Drop().IgnoreError();
        return absl::AbortedError(why);
      }).IgnoreError();
    }
    GiveUpControlOfGonePage();
    const auto there = std::chrono::steady_clock::now();
    const bool went = pages_.Went(there);
    if (went)
      requests_.erase(std::remove_if(requests_.begin(), requests_.end(),
                                     [&](const std::string& page) { return !pages_.IsThere(page, there); }),
                      requests_.end());
    if (went || news) {
      lock.unlock();
      Changed();
      lock.lock();
    }
    changed_.wait_for(lock, kLookEvery, [this] { return ending_; });
  }
}

bool RigDesk::ControllerWent() const {
  return source_ != nullptr && !controller_.empty() &&
         !pages_.IsThere(controller_, std::chrono::steady_clock::now());
}

// Never while something moves or is under way; a run that waits for a person ends by itself.
void RigDesk::GiveUpControlOfGonePage() {
  if (!ControllerWent()) return;
  if (!asked_.empty()) changed_.notify_all();
  if (!job_.name.empty() || moving_) return;
  const std::string error = last_error_;  // of what it had begun
  BeginJob("giving the lease back", false, [this, error, page = pages_.Name(controller_)] {
    const absl::Status dropped = Drop();
    const std::lock_guard<std::mutex> lock(mutex_);
    last_error_ = error;
    last_text_ = absl::StrCat(page, ", which controlled the rig, went; its lease was given back");
    return dropped;
  }).IgnoreError();
}

void RigDesk::Work() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return ending_ || job_.run != nullptr; });
    if (ending_) return;
    const std::function<absl::Status()> run = std::exchange(job_.run, nullptr);
    lock.unlock();
    Changed();
    const absl::Status status = run();
    lock.lock();
    if (!status.ok())
      last_error_ =
          stopping_ && absl::IsCancelled(status) ? std::string("stopped") : std::string(status.message());
    else if (last_text_.empty())
      last_text_ = job_.name + ": done";
    job_ = {};
    lock.unlock();
    Changed();
    lock.lock();
  }
}

absl::StatusOr<std::string> RigDesk::Drawing() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (run_ == nullptr) return absl::FailedPreconditionError("no dry run was made yet");
  json drawing = run_->drawing();
  drawing["check"] = check_;
  return drawing.dump(-1, ' ', false, json::error_handler_t::replace);
}

std::string RigDesk::StateText() const {
  std::vector<std::string> objects;
  for (const auto& [name, object] : objects_) objects.push_back(name);
  json state = {{"rig", rig_json_},
                {"address", address_},
                {"objects", objects},
                {"beat", beat_},
                {"pages", pages_.List(std::chrono::steady_clock::now(), controller_)},
                {"controller", controller_},
                {"leased", source_ != nullptr},
                {"requests", requests_},
                {"job", job_.name},
                {"job_moves", job_.moves},
                {"stopping", stopping_},
                {"ask", asked_},
                {"ask_id", ask_},
                {"check", check_},
                {"checked", run_ ? run_->checked() : json()},
                {"done", done_},
                {"error", last_error_},
                {"text", last_text_}};
  return state.dump(-1, ' ', false, json::error_handler_t::replace);
}

void RigDesk::Changed() {
  const std::lock_guard<std::mutex> publishing(publishing_);
  std::string text;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (rig_json_.empty()) return;  // nothing is known before the first look
    text = StateText();
  }
  watchers_->Publish(std::move(text));
}

void RigDesk::Watch(std::shared_ptr<Exchange> exchange) {
  watchers_->Add(std::move(exchange));
  // Under the lock, so that Look cannot miss it between its test and its wait.
  const std::lock_guard<std::mutex> lock(mutex_);
  changed_.notify_all();
}

}  // namespace touchstone::workbench
