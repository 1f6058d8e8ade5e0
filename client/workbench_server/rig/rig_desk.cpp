#include "client/workbench_server/rig/rig_desk.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "server/base/status.h"
#include "server/base/text/printable.h"

namespace touchstone::workbench {
namespace {

constexpr size_t kMaxPageId = 64;

bool IsPageId(const std::string& text) {
  return !text.empty() && text.size() <= kMaxPageId &&
         std::all_of(text.begin(), text.end(), [](char c) { return absl::ascii_isalnum(c) || c == '-'; });
}

}  // namespace

absl::StatusOr<std::unique_ptr<RigDesk>> RigDesk::Open(std::unique_ptr<client::Connection> rig,
                                                       std::function<void(const std::string&)> log) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::DescribeResponse source,
                              rig->Call(&v1::Source::Stub::Describe, v1::DescribeRequest()));
  if (source.kind() != v1::SOURCE_KIND_PHYSICAL)
    return absl::FailedPreconditionError(
        absl::StrCat("--rig: ", rig->address(), " is a ", client::SourceKindName(source.kind()),
                     " source, which has no rig; a touchstone-gateway was expected"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::ListObjectsResponse served,
                              rig->Call(&v1::Source::Stub::ListObjects, v1::ListObjectsRequest()));
  ObjectsOfSource objects;
  for (const v1::Object& object : served.objects()) objects[object.name()] = object;
  return std::unique_ptr<RigDesk>(new RigDesk(std::move(rig), std::move(objects), std::move(log)));
}

RigDesk::RigDesk(std::unique_ptr<client::Connection> rig, ObjectsOfSource objects,
                 std::function<void(const std::string&)> log)
    : rig_(std::move(rig)),
      address_(rig_->address()),
      objects_(std::move(objects)),
      log_(std::move(log)),
      control_(v1::Control::NewStub(rig_->channel())),
      state_(v1::Rig::NewStub(rig_->channel())),
      sessions_(v1::Sessions::NewStub(rig_->channel())) {
  worker_ = std::thread(&RigDesk::Work, this);
  looker_ = std::thread(&RigDesk::Look, this);
}

RigDesk::~RigDesk() {
  bool moves = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    moves = job_.moves;
  }
  if (moves) Stop(Json{{"reason", "touchstone workbench ends"}}.dump()).status().IgnoreError();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ending_ = stopping_ = true;
  }
  changed_.notify_all();
  worker_.join();
  looker_.join();
  source_.reset();
}

absl::Status RigDesk::Act(const std::string& request) {
  const Json parsed = Json::parse(request, nullptr, /*allow_exceptions=*/false);
  if (!parsed.is_object()) return absl::InvalidArgumentError("an act is a JSON object");
  absl::Status status;
  bool changed = true;
  try {
    const std::string page = parsed.at("page"), act = parsed.at("act");
    if (!IsPageId(page))
      return absl::InvalidArgumentError("page: 1 to 64 letters, digits and dashes were expected");
    const auto now = std::chrono::steady_clock::now();
    const std::lock_guard<std::mutex> lock(mutex_);
    if (act == "bye") {
      pages_.SayGoodbye(page, now);
      return absl::OkStatus();
    }
    const Pages::Said said{parsed.value("hidden", false), act != "hello" || parsed.value("begins", false)};
    TOUCHSTONE_RETURN_IF_ERROR(pages_.Hear(page, said, now, &changed));
    if (act != "hello") {
      status = ActLocked(page, act, parsed);
      changed = true;
    }
  } catch (const Json::exception& error) {
    return absl::InvalidArgumentError(absl::StrCat("an act of the page: ", error.what()));
  }
  if (changed) Changed();
  return status;
}

absl::Status RigDesk::CheckControls(const std::string& page) const {
  if (controller_ == page && source_ != nullptr) return absl::OkStatus();
  return absl::FailedPreconditionError(
      controller_.empty() ? std::string("no page controls the rig; take control first")
                          : absl::StrCat(pages_.Name(controller_), " controls the rig; ask it for control"));
}

absl::Status RigDesk::CheckConfirmed(const Json& request) const {
  if (request.value("confirmed", false)) return absl::OkStatus();
  return absl::FailedPreconditionError("the arm would move, and nobody has agreed to that");
}

absl::Status RigDesk::BeginJob(std::string name, bool moves, std::function<absl::Status()> run) {
  if (!job_.name.empty())
    return absl::FailedPreconditionError(absl::StrCat("the rig is at something else: ", job_.name));
  job_ = {std::move(name), moves, std::move(run)};
  stopping_ = false;
  last_error_.clear();
  last_text_.clear();
  changed_.notify_all();
  return absl::OkStatus();
}

absl::Status RigDesk::ActLocked(const std::string& page, const std::string& act, const Json& request) {
  if (act == "acquire" || act == "take_lease") {
    if (!controller_.empty() && controller_ != page) return CheckControls(page);
    if (source_ != nullptr) return absl::OkStatus();
    const bool take = act == "take_lease";
    if (take && moving_)
      return absl::FailedPreconditionError(
          "somebody else moves the rig now: wait until it stands still, or stop it");
    return BeginJob("taking control", false, [this, page, take] { return Acquire(page, take); });
  }
  if (act == "request" || act == "decline" || act == "give" || act == "take" || act == "release")
    return Between(page, act, request);
  if (act == "check") {
    if (!controller_.empty()) TOUCHSTONE_RETURN_IF_ERROR(CheckControls(page));
    return BeginJob("dry run", false, [this, plan = request.at("plan")]() -> absl::Status {
      const auto go_on = [this] {
        const std::lock_guard<std::mutex> lock(mutex_);
        return !stopping_;
      };
      absl::StatusOr<std::unique_ptr<TouchRun>> checked;
      try {
        checked = TouchRun::Check(rig_.get(), plan, objects_, go_on);
      } catch (const Json::exception& error) {
        return absl::InvalidArgumentError(absl::StrCat("the plan: ", error.what()));
      }
      TOUCHSTONE_RETURN_IF_ERROR(checked.status());
      const std::lock_guard<std::mutex> lock(mutex_);
      run_ = *std::move(checked);
      ++check_;
      done_ = 0;
      watchers_->Clear();
      return absl::OkStatus();
    });
  }
  TOUCHSTONE_RETURN_IF_ERROR(CheckControls(page));
  if (act == "reset") {
    const std::string reason = request.at("reason");
    if (reason.empty())
      return absl::InvalidArgumentError("say why the rig may move again, for instance: cable freed");
    return BeginJob("releasing the stop", false, [this, page, reason] { return Reset(reason, page); });
  }
  TOUCHSTONE_RETURN_IF_ERROR(CheckConfirmed(request));
  if (interrupted_) return absl::FailedPreconditionError("the rig was stopped; release the stop first");
  if (act == "mounted") {
    if (asked_.empty() || request.at("ask") != ask_)
      return absl::FailedPreconditionError("nothing is to be put on the fixture now");
    asked_.clear();
    changed_.notify_all();
    return absl::OkStatus();
  }
  if (act == "power_on")
    return BeginJob("powering the arm on", true, [this] { return source_->PowerOn().status(); });
  if (act == "home") return BeginJob("going home", true, [this] { return source_->Home().status(); });
  if (act != "start")
    return absl::InvalidArgumentError(absl::StrCat("act: '", Printable(act, kMaxPageId), "' is unknown"));
  if (run_ == nullptr || request.at("check") != check_)
    return absl::FailedPreconditionError(
        "this is not the plan that was checked last; make the dry run again");
  return BeginJob("touching", true,
                  [this, skip = request.value("skip_impossible", false)] { return RunTouches(skip); });
}

// Control between pages.
absl::Status RigDesk::Between(const std::string& page, const std::string& act, const Json& request) {
  if (act == "request") {
    if (controller_ != page && std::find(requests_.begin(), requests_.end(), page) == requests_.end())
      requests_.push_back(page);
    return absl::OkStatus();
  }
  if (act == "take" && (controller_.empty() || source_ == nullptr))
    return absl::FailedPreconditionError("no page controls the rig; take control with its lease");
  if (act != "take") TOUCHSTONE_RETURN_IF_ERROR(CheckControls(page));
  if (act == "decline") {
    requests_.clear();
    return absl::OkStatus();
  }
  if (!job_.name.empty())
    return absl::FailedPreconditionError(absl::StrCat(
        "control does not change hands while the rig is at work (", job_.name, "); stop it, or wait"));
  if (act == "release") return BeginJob("giving the lease back", false, [this] { return Drop(); });
  const std::string to = act == "take" ? page : request.at("to").get<std::string>();
  if (!pages_.IsThere(to, std::chrono::steady_clock::now()))
    return absl::NotFoundError("that page is not there any more");
  controller_ = to;
  requests_.clear();
  last_error_.clear();
  last_text_ = absl::StrCat(pages_.Name(to), " controls the rig now");
  return absl::OkStatus();
}

}  // namespace touchstone::workbench
