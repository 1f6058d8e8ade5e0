#include "client/source/connection/leased_source.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "server/base/status.h"

namespace touchstone::client {
namespace {

constexpr std::chrono::seconds kStopAnswer{2};

}  // namespace

absl::StatusOr<std::unique_ptr<LeasedSource>> LeasedSource::Open(Connection* connection,
                                                                 LeasedSourceOptions options) {
  std::unique_ptr<LeasedSource> source(new LeasedSource(connection, std::move(options)));
  TOUCHSTONE_ASSIGN_OR_RETURN(source->description_,
                              connection->Call(&v1::Source::Stub::Describe, v1::DescribeRequest()));
  source->channel_ = connection->channel();
  LeaseOptions lease;
  lease.take = source->options_.take_lease;
  lease.clock = source->options_.clock;
  TOUCHSTONE_ASSIGN_OR_RETURN(source->lease_,
                              LeaseKeeper::Acquire(connection, source->description_, std::move(lease)));
  return source;
}

size_t LeasedSource::touches_per_request() const {
  // What moves takes seconds per touch; a recorded source can tell repeats apart only within a request.
  return description_.lease_required() ? 1 : std::max<uint32_t>(1, description_.max_touches_per_request());
}

template <typename Stub, typename Request, typename Response>
absl::StatusOr<Response> LeasedSource::Call(Stub& stub,
                                            grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&,
                                                                         Response*),
                                            Request* request) {
  if (lease_->required()) request->set_lease_token(lease_->token());
  grpc::ClientContext context;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    if (interrupted_) return absl::CancelledError("interrupted");
    running_ = &context;
  }
  Response response;
  absl::Status status = FromGrpc((stub.*method)(&context, *request, &response));
  std::lock_guard<std::mutex> lock(mutex_);
  running_ = nullptr;
  if (interrupted_) return absl::CancelledError("interrupted");
  // Why the lease was lost says more than that it is stale.
  if (absl::IsAborted(status) && !lease_->status().ok()) status = lease_->status();
  if (!status.ok()) return status;
  return response;
}

template <typename Request, typename Response>
absl::StatusOr<Response> LeasedSource::CallAgain(
    grpc::Status (v1::Source::Stub::*method)(grpc::ClientContext*, const Request&, Response*),
    Request* request) {
  RetryOptions retry;
  retry.retry_for_s = options_.reconnect_s;
  retry.clock = options_.clock;
  retry.wait = [this](double seconds) { return SleepFor(seconds).ok(); };
  retry.log = options_.log;
  absl::StatusOr<Response> response;
  TOUCHSTONE_RETURN_IF_ERROR(connection_->Retrying(
      [&] {
        response = Call(connection_->source(), method, request);
        return response.status();
      },
      retry));
  return response;
}

absl::StatusOr<v1::TouchResponse> LeasedSource::Touch(v1::TouchRequest request) {
  Retry retry(connection_->server_count(), options_.reconnect_s, *options_.clock);
  bool again = false;
  while (true) {
    absl::StatusOr<v1::TouchResponse> response =
        lease_->required() ? Call(connection_->source(), &v1::Source::Stub::Touch, &request)
                           : CallAgain(&v1::Source::Stub::Touch, &request);
    const int results = response.ok() ? response->results_size() : request.touches_size();
    if (results != request.touches_size())
      return absl::InternalError(
          absl::StrCat("the source gave ", results, " results for ", request.touches_size(), " touches"));
    // Asked for again, the touch may still be under way, or the lease that of the process before.
    const bool passing = IsLostServer(response.status()) || (again && absl::IsAborted(response.status()));
    if (response.ok() || !passing) return response;
    if (!lease_->required() || request.touch_ids().empty()) return response;
    const std::optional<double> pause_s = retry.PauseAfter(1);
    if (!pause_s) return response;
    if (options_.log)
      options_.log(absl::StrCat(connection_->address(), ": ", response.status().message(),
                                "; the same touch is asked for again"));
    TOUCHSTONE_RETURN_IF_ERROR(SleepFor(*pause_s));
    again = true;
    const absl::Status found = FindAgain();
    if (!found.ok() && !IsLostServer(found)) return found;
  }
}

absl::StatusOr<v1::CaptureResponse> LeasedSource::Capture(v1::CaptureRequest request) {
  return lease_->required() ? Call(connection_->source(), &v1::Source::Stub::Capture, &request)
                            : CallAgain(&v1::Source::Stub::Capture, &request);
}

absl::StatusOr<v1::RigState> LeasedSource::Mount(const std::string& object, v1::UpFace up_face) {
  v1::MountObjectRequest request;
  request.set_object(object);
  request.set_up_face(up_face);
  return Call(connection_->rig(), &v1::Rig::Stub::MountObject, &request);
}

absl::Status LeasedSource::EnsureMounted(const v1::RigState& state, const std::string& object,
                                         v1::UpFace up_face, const std::function<absl::Status()>& ask) {
  if (state.object() == object && state.up_face() == up_face) return absl::OkStatus();
  if (!state.mounts_itself()) {
    TOUCHSTONE_RETURN_IF_ERROR(Home().status());
    TOUCHSTONE_RETURN_IF_ERROR(ask());
  }
  return Mount(object, up_face).status();
}

absl::StatusOr<v1::RigState> LeasedSource::PowerOn() {
  v1::PowerOnRequest request;
  return Call(connection_->rig(), &v1::Rig::Stub::PowerOn, &request);
}

absl::StatusOr<v1::RigState> LeasedSource::Home() {
  v1::HomeRequest request;
  return Call(connection_->rig(), &v1::Rig::Stub::Home, &request);
}

// The next server that answers must be the same kind of source; the lease goes along.
absl::Status LeasedSource::FindAgain() {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kStopAnswer);
  v1::State state;
  // A part of the rig may have failed while the gateway is there.
  const bool there = connection_->control().GetState(&context, v1::GetStateRequest(), &state).ok();
  if (!there) TOUCHSTONE_RETURN_IF_ERROR(connection_->ConnectToNext());
  {
    std::lock_guard<std::mutex> lock(mutex_);
    channel_ = connection_->channel();
  }
  if (there && (state.state() == v1::SOURCE_STATE_STOPPED || !state.stop_reason().empty()))
    return absl::FailedPreconditionError(absl::StrCat(
        "the source was stopped ", state.stop_reason(),
        ": make sure that it may move, then release the stop with 'touchstone rig reset' and run the "
        "same command again"));
  return lease_->Follow(connection_);
}

absl::Status LeasedSource::SleepFor(double seconds) {
  std::unique_lock<std::mutex> lock(mutex_);
  if (options_.clock->WaitFor(lock, interruption_, seconds, [this] { return interrupted_; }))
    return absl::CancelledError("interrupted");
  return absl::OkStatus();
}

void LeasedSource::Interrupt(const std::string& reason) {
  std::shared_ptr<grpc::Channel> channel;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    interrupted_ = true;
    channel = channel_;
  }
  interruption_.notify_all();
  if (physical()) {
    // Before anything else: what moves stops.
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kStopAnswer);
    v1::StopRequest request;
    request.set_reason(reason);
    request.set_holder(LeaseHolder());
    v1::StopResponse response;
    const grpc::Status stopped = v1::Control::NewStub(channel)->Stop(&context, request, &response);
    if (!stopped.ok() && options_.log)
      options_.log(absl::StrCat("STOP DID NOT REACH THE SOURCE: ", stopped.error_message(),
                                "; use the emergency stop if anything moves"));
    if (stopped.ok() && description_.lease_required() && options_.log)
      options_.log("the rig is stopped, until 'touchstone rig reset' releases it");
  }
  EndCalls();
}

void LeasedSource::EndCalls() {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    interrupted_ = true;
    if (running_ != nullptr) running_->TryCancel();
  }
  interruption_.notify_all();
}

}  // namespace touchstone::client
