#include "client/source/connection/lease_keeper.h"

#include <absl/strings/str_cat.h>
#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <thread>

#include "server/base/status.h"

namespace touchstone::client {
namespace {

constexpr double kRenewalsAWindow = 5;
constexpr double kShortestAnswerS = 0.5;  // what a call to a busy source gets at the least
constexpr double kAcquireS = 10;
// A lease that is not renewed, because its holder was killed, has ended by then.
constexpr double kHolderMayBeGoneS = 2.5;
constexpr double kAskAgainS = 0.1;
constexpr size_t kMaxHolderBytes = 256;

std::mutex holder_mutex;
std::string holder_program;  // guarded by holder_mutex; empty: not set

// The login name; "uid1000" where a user has none, as in a container.
std::string UserName() {
  for (const char* variable : {"LOGNAME", "USER"})
    if (const char* name = std::getenv(variable); name != nullptr && *name != '\0') return name;
  passwd entry{};
  passwd* found = nullptr;
  char text[4096];
  if (::getpwuid_r(::getuid(), &entry, text, sizeof text, &found) == 0 && found != nullptr)
    return found->pw_name;
  return absl::StrCat("uid", ::getuid());
}

// One unary call that ends within `seconds`.
template <typename Request, typename Response>
absl::StatusOr<Response> CallWithin(double seconds,
                                    grpc::Status (v1::Control::Stub::*method)(grpc::ClientContext*,
                                                                              const Request&, Response*),
                                    v1::Control::Stub* control, const Request& request) {
  grpc::ClientContext context;
  context.set_deadline(
      std::chrono::system_clock::now() +
      std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::duration<double>(seconds)));
  Response response;
  TOUCHSTONE_RETURN_IF_ERROR(FromGrpc((control->*method)(&context, request, &response)));
  return response;
}

}  // namespace

void SetHolderProgram(const std::string& program) {
  const std::lock_guard<std::mutex> lock(holder_mutex);
  holder_program = program;
}

std::string LeaseHolder() {
  char host[256] = "";
  ::gethostname(host, sizeof host - 1);
  const std::string process = absl::StrCat(" ", ::getpid());
  std::string program;
  {
    const std::lock_guard<std::mutex> lock(holder_mutex);
    program = holder_program.empty() ? ::program_invocation_short_name : holder_program;
  }
  // The process tells two programs apart, so it is never cut.
  return absl::StrCat(UserName(), "@", host[0] != '\0' ? host : "localhost", " ", program)
             .substr(0, kMaxHolderBytes - process.size()) +
         process;
}

absl::StatusOr<std::unique_ptr<LeaseKeeper>> LeaseKeeper::Acquire(Connection* connection,
                                                                  const v1::DescribeResponse& source,
                                                                  LeaseOptions options) {
  if (options.holder.empty()) options.holder = LeaseHolder();
  std::unique_ptr<LeaseKeeper> keeper(new LeaseKeeper(std::move(options), source.lease_required()));
  if (!keeper->required_) return keeper;
  keeper->control_ = v1::Control::NewStub(connection->channel());
  const Clock& clock = *keeper->options_.clock;
  const Clock::Time until = clock.In(kHolderMayBeGoneS);
  absl::Status status = keeper->AcquireNow(keeper->control_.get(), keeper->options_.take);
  while (absl::IsFailedPrecondition(status) && clock.Now() < until) {
    clock.SleepFor(kAskAgainS);
    status = keeper->AcquireNow(keeper->control_.get(), false);
  }
  TOUCHSTONE_RETURN_IF_ERROR(status);
  keeper->thread_ = std::thread(&LeaseKeeper::Run, keeper.get());
  return keeper;
}

LeaseKeeper::~LeaseKeeper() {
  if (!thread_.joinable()) return;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
  if (!status_.ok()) return;
  v1::ReleaseLeaseRequest request;
  request.set_token(lease_.token());
  // Unanswered, it runs out by itself.
  CallWithin(std::max(lease_.window_s(), kShortestAnswerS), &v1::Control::Stub::ReleaseLease, control_.get(),
             request)
      .status()
      .IgnoreError();
}

std::string LeaseKeeper::token() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return lease_.token();
}

absl::Status LeaseKeeper::status() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return status_;
}

absl::Status LeaseKeeper::AcquireNow(v1::Control::Stub* control, bool take) {
  v1::AcquireLeaseRequest request;
  request.set_holder(options_.holder);
  request.set_take(take);
  const absl::StatusOr<v1::Lease> lease =
      CallWithin(kAcquireS, &v1::Control::Stub::AcquireLease, control, request);
  if (absl::IsFailedPrecondition(lease.status())) {
    const absl::StatusOr<v1::State> state =
        CallWithin(kAcquireS, &v1::Control::Stub::GetState, control, v1::GetStateRequest());
    if (!state.ok() || state->lease_holder().empty()) return lease.status();
    return absl::FailedPreconditionError(absl::StrCat(
        "'", state->lease_holder(), "' holds the lease of this source (epoch ", state->lease_epoch(),
        "): wait until they are done, or take it from them with --take-lease"));
  }
  TOUCHSTONE_RETURN_IF_ERROR(lease.status());
  std::lock_guard<std::mutex> lock(mutex_);
  lease_ = *lease;
  status_ = absl::OkStatus();
  return absl::OkStatus();
}

absl::Status LeaseKeeper::Follow(Connection* connection) {
  if (!required_) return absl::OkStatus();
  const std::shared_ptr<v1::Control::Stub> control = v1::Control::NewStub(connection->channel());
  v1::RenewLeaseRequest request;
  request.set_token(token());
  const absl::StatusOr<v1::Lease> renewed =
      CallWithin(kAcquireS, &v1::Control::Stub::RenewLease, control.get(), request);
  if (renewed.ok()) {
    std::lock_guard<std::mutex> lock(mutex_);
    lease_ = *renewed;
    status_ = absl::OkStatus();
  } else {
    if (!absl::IsAborted(renewed.status())) return renewed.status();
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::State state, CallWithin(kAcquireS, &v1::Control::Stub::GetState,
                                                                  control.get(), v1::GetStateRequest()));
    if (state.state() == v1::SOURCE_STATE_STOPPED || !state.stop_reason().empty())
      return absl::FailedPreconditionError(absl::StrCat(
          "the source was stopped ", state.stop_reason(),
          " while the lease was lost: make sure that it may move, then release the stop with 'touchstone rig "
          "reset' and run the same command again"));
    TOUCHSTONE_RETURN_IF_ERROR(AcquireNow(control.get(), false));
  }
  {
    std::lock_guard<std::mutex> lock(mutex_);
    control_ = control;
  }
  changed_.notify_all();
  return absl::OkStatus();
}

// What people need to know: who has it now.
absl::Status LeaseKeeper::Lost(v1::Control::Stub* control, const absl::Status& why) const {
  if (!absl::IsAborted(why))
    return absl::AbortedError(
        absl::StrCat("the lease ran out, because the source did not answer: ", why.message()));
  const absl::StatusOr<v1::State> state =
      CallWithin(kShortestAnswerS, &v1::Control::Stub::GetState, control, v1::GetStateRequest());
  if (state.ok() && !state->lease_holder().empty())
    return absl::AbortedError(absl::StrCat("'", state->lease_holder(), "' took the lease (epoch ",
                                           state->lease_epoch(),
                                           "); agree with them, then run the same command again to resume"));
  return absl::AbortedError(absl::StrCat("the lease was lost: ", why.message()));
}

void LeaseKeeper::Run() {
  const Clock& clock = *options_.clock;
  Clock::Time renewed_at = clock.Now();
  std::unique_lock<std::mutex> lock(mutex_);
  while (!ending_) {
    const double window_s = std::max(lease_.window_s(), 0.01);
    const std::string token = lease_.token();
    if (!status_.ok()) {
      // Lost: until Follow finds another one.
      changed_.wait(lock, [&] { return ending_ || status_.ok(); });
      renewed_at = clock.Now();
      continue;
    }
    if (clock.WaitFor(lock, changed_, window_s / kRenewalsAWindow,
                      [&] { return ending_ || lease_.token() != token; })) {
      renewed_at = clock.Now();
      continue;
    }
    const std::shared_ptr<v1::Control::Stub> control = control_;
    lock.unlock();
    const Clock::Time asked_at = clock.Now();
    v1::RenewLeaseRequest request;
    request.set_token(token);
    absl::Status status = CallWithin(std::max(window_s / 2, kShortestAnswerS), &v1::Control::Stub::RenewLease,
                                     control.get(), request)
                              .status();
    // A source that is not to be reached may be there again before the window is over.
    if (status.ok()) renewed_at = asked_at;
    const bool over = absl::IsAborted(status) || (!status.ok() && clock.SecondsSince(renewed_at) > window_s);
    if (over) status = Lost(control.get(), status);
    lock.lock();
    if (!over || ending_ || lease_.token() != token) continue;
    status_ = status;
    if (!options_.on_lost) continue;
    lock.unlock();
    options_.on_lost(status);
    lock.lock();
  }
}

}  // namespace touchstone::client
