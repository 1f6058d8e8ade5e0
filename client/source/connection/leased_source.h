// A source as the commands that touch and photograph use it: with a lease where it needs one, with ids, and
// with repeated attempts when it was lost. A virtual source and a physical one look the same from here.
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include <absl/status/statusor.h>

#include "client/source/connection/connection.h"
#include "client/source/connection/lease_keeper.h"
#include "server/base/threads/clock.h"

namespace touchstone::client {

struct LeasedSourceOptions {
  bool take_lease = false;
  // How long a lost source is looked for before a touch fails with UNAVAILABLE.
  double reconnect_s = kRetryForS;
  const Clock* clock = &SteadyClock();  // outlives the source
  // Called when a source was lost, found again, or lost its lease.
  std::function<void(const std::string&)> log;
};

class LeasedSource {
 public:
  // `connection` must outlive it.
  static absl::StatusOr<std::unique_ptr<LeasedSource>> Open(Connection* connection,
                                                            LeasedSourceOptions options = {});

  const v1::DescribeResponse& description() const { return description_; }
  bool physical() const { return description_.kind() == v1::SOURCE_KIND_PHYSICAL; }
  // Touches to send in one request: one where each takes seconds, so that each is seen when it is done.
  size_t touches_per_request() const;

  // With the lease. A request with touch ids is repeated with the same ids when the source was lost, within
  // reconnect_s; one without is not where something moves, since it is unknown which touches were made.
  absl::StatusOr<v1::TouchResponse> Touch(v1::TouchRequest request);
  absl::StatusOr<v1::CaptureResponse> Capture(v1::CaptureRequest request);
  // Where it does not lie so, by `state`: the rig changes it, or the arm goes home, then `ask` lets a person put it down, and
  // the source is told. Nobody is asked before the arm is at home.
  absl::Status EnsureMounted(const v1::RigState& state, const std::string& object, v1::UpFace up_face,
                             const std::function<absl::Status()>& ask);
  absl::StatusOr<v1::RigState> Mount(const std::string& object, v1::UpFace up_face);
  absl::StatusOr<v1::RigState> PowerOn();
  absl::StatusOr<v1::RigState> Home();
  LeaseKeeper* lease() { return lease_.get(); }

  // Ends what is under way: at a physical source Control.Stop first. Safe from any thread; what
  // runs returns CANCELLED.
  void Interrupt(const std::string& reason);
  // The same for a caller that has stopped the source itself.
  void EndCalls();

 private:
  LeasedSource(Connection* connection, LeasedSourceOptions options)
      : connection_(connection), options_(std::move(options)) {}
  // One call that Interrupt ends; the lease's own error where the lease was lost.
  template <typename Stub, typename Request, typename Response>
  absl::StatusOr<Response> Call(Stub& stub,
                                grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                                Request* request);
  // The same, made again by the connection's policy where it was lost: for sources that move nothing.
  template <typename Request, typename Response>
  absl::StatusOr<Response> CallAgain(grpc::Status (v1::Source::Stub::*method)(grpc::ClientContext*,
                                                                              const Request&, Response*),
                                     Request* request);
  absl::Status FindAgain();
  absl::Status SleepFor(double seconds);

  Connection* connection_;
  LeasedSourceOptions options_;
  v1::DescribeResponse description_;
  std::unique_ptr<LeaseKeeper> lease_;
  std::mutex mutex_;  // guards what Interrupt uses
  std::condition_variable interruption_;
  bool interrupted_ = false;
  grpc::ClientContext* running_ = nullptr;
  std::shared_ptr<grpc::Channel> channel_;
};

}  // namespace touchstone::client
