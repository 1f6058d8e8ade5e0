// What the desk does at the rig: its lease, its motions, its stop, and what was measured.
#include <absl/strings/str_cat.h>

#include <chrono>
#include <utility>

#include "client/workbench_server/rig/rig_desk.h"
#include "server/base/status.h"
#include "server/base/text/printable.h"
#include "server/model/model.h"

namespace touchstone::workbench {
namespace {

constexpr std::chrono::seconds kStopAnswer{2}, kExportAnswer{30};
constexpr size_t kMaxReason = 300;

}  // namespace

absl::Status RigDesk::Acquire(const std::string& page, bool take) {
  client::LeasedSourceOptions options;
  options.take_lease = take;
  options.log = log_;
  absl::StatusOr<std::unique_ptr<client::LeasedSource>> source =
      client::LeasedSource::Open(rig_.get(), std::move(options));
  if (absl::IsFailedPrecondition(source.status())) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kStopAnswer);
    v1::State state;
    if (control_->GetState(&context, v1::GetStateRequest(), &state).ok() && !state.lease_holder().empty())
      return absl::FailedPreconditionError(
          absl::StrCat("'", state.lease_holder(),
                       "' holds the lease of this rig: wait until they are done, or agree "
                       "with them and take it"));
  }
  TOUCHSTONE_RETURN_IF_ERROR(source.status());
  const std::lock_guard<std::mutex> lock(mutex_);
  source_ = *std::move(source);
  controller_ = page;
  requests_.clear();
  last_text_ = absl::StrCat(pages_.Name(page), " controls the rig");
  return absl::OkStatus();
}

absl::Status RigDesk::Drop() {
  std::unique_ptr<client::LeasedSource> source;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    source = std::move(source_);
    controller_.clear();
    interrupted_ = false;
  }
  return absl::OkStatus();  // the lease goes back with the source
}

absl::Status RigDesk::Reset(const std::string& reason, const std::string& page) {
  v1::ResetRequest request;
  request.set_holder(client::LeaseHolder());
  request.set_reason(reason);
  TOUCHSTONE_RETURN_IF_ERROR(rig_->CallOnce(&v1::Control::Stub::Reset, request).status());
  // The stop's release has ended the lease, and the source that was interrupted goes on no more.
  TOUCHSTONE_RETURN_IF_ERROR(Drop());
  return Acquire(page, false);
}

absl::Status RigDesk::RunTouches(bool skip_impossible) {
  RunEvents events;
  events.touched = [this](std::string touch) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      ++done_;
    }
    watchers_->Append(std::move(touch));
    Changed();
  };
  events.ask = [this](const std::string& words) { return AskPerson(words); };
  events.go_on = [this] {
    const std::lock_guard<std::mutex> lock(mutex_);
    return !stopping_;
  };
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    done_ = 0;
    watchers_->Clear();
  }
  return run_->TouchAll(rig_.get(), source_.get(), skip_impossible, events);
}

absl::Status RigDesk::AskPerson(const std::string& words) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    asked_ = words;
    ++ask_;
  }
  Changed();
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait(lock, [this] { return asked_.empty() || stopping_ || ending_ || ControllerWent(); });
  const bool answered = asked_.empty();
  asked_.clear();
  if (stopping_ || ending_) return absl::CancelledError("stopped");
  if (answered) return absl::OkStatus();
  return absl::AbortedError(
      absl::StrCat(pages_.Name(controller_),
                   ", which controlled the rig, went while the rig waited for a person to do this: ", words,
                   ". Start the same plan again: touches that are made are not made again"));
}

absl::StatusOr<std::string> RigDesk::Stop(const std::string& request) {
  const Json parsed = Json::parse(request, nullptr, /*allow_exceptions=*/false);
  const auto text = [&](const char* name) {
    return parsed.is_object() && parsed.contains(name) && parsed[name].is_string()
               ? parsed[name].get<std::string>()
               : "";
  };
  const std::string press = text("press");
  {
    std::unique_lock<std::mutex> lock(mutex_);
    stopping_ = true;
    // Sent by two ways; the first to come stops the rig, and both have its answer.
    if (!press.empty() && press == press_) {
      changed_.wait_for(lock, kStopAnswer,
                        [&] { return press != press_ || !press_answer_.ok() || !press_answer_->empty(); });
      return press_answer_;
    }
    press_ = press;
    press_answer_ = std::string();
  }
  changed_.notify_all();
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kStopAnswer);
  v1::StopRequest stop;
  stop.set_reason(text("reason").empty() ? "stopped on the page" : Printable(text("reason"), kMaxReason));
  stop.set_holder(client::LeaseHolder());
  v1::StopResponse response;
  const absl::Status sent = client::FromGrpc(control_->Stop(&context, stop, &response));
  absl::StatusOr<std::string> answer = absl::UnavailableError(absl::StrCat(
      "THE STOP DID NOT REACH THE RIG: ", sent.message(), ". Press the emergency stop if anything moves"));
  if (sent.ok())
    answer = Json{{"aborted_touches", response.aborted_touches()},
                  {"standstill", response.standstill()},
                  {"not_confirmed", response.not_confirmed()}}
                 .dump();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (source_ != nullptr) {
      source_->EndCalls();
      interrupted_ = true;
    }
    press_answer_ = answer;
  }
  changed_.notify_all();
  log_(sent.ok() ? std::string("stopped on the page; it holds until somebody releases it")
                 : std::string(answer.status().message()));
  return answer;
}

absl::StatusOr<std::string> RigDesk::SetCsv() {
  v1::ExportSessionRequest request;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (run_ == nullptr) return absl::FailedPreconditionError("no run was made yet");
    request.set_name(run_->session());
  }
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kExportAnswer);
  const auto reader = sessions_->ExportSession(&context, request);
  std::string csv;
  v1::ExportSessionResponse piece;
  while (reader->Read(&piece))
    if (piece.file().empty() || piece.file() == "touches.csv") csv += piece.csv();
  TOUCHSTONE_RETURN_IF_ERROR(client::FromGrpc(reader->Finish()));
  return csv;
}

absl::StatusOr<v1::Evidence> RigDesk::Evidence() {
  v1::Evidence evidence;
  TOUCHSTONE_ASSIGN_OR_RETURN(*evidence.mutable_csv(), SetCsv());
  const std::lock_guard<std::mutex> lock(mutex_);
  evidence.set_origin(absl::StrCat("session ", run_->session(), " of ", address_));
  model::Model nominal =
      model::NominalModel(rig_json_.value("fingers", 3), rig_json_.value("spacing_m", 0.03));
  nominal.name = "nominal";
  evidence.mutable_model()->set_yaml(model::FormatModel(nominal));
  return evidence;
}

}  // namespace touchstone::workbench
