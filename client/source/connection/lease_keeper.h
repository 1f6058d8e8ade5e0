// The lease of a source that moves something: acquired when the source says that it needs one, kept alive
// by a thread, given back at the end. At a source that needs none there is nothing, and every caller can
// do the same.
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "client/source/connection/connection.h"
#include "server/base/threads/clock.h"

namespace touchstone::client {

struct LeaseOptions {
  // Who asks, for people. Default (empty): LeaseHolder().
  std::string holder;
  // Takes the lease from whoever holds it.
  bool take = false;
  // Told once, from the keeper's own thread, when the lease is lost.
  std::function<void(const absl::Status&)> on_lost;
  // Of the renewals; outlives the keeper.
  const Clock* clock = &SteadyClock();
};

// Person, program and process, so that two programs of one person are told apart: "ana@lab rig-run 4711". At most 256
// characters.
std::string LeaseHolder();
// What LeaseHolder calls this program from now on, without spaces: "rig-run". Default: the name of the executable.
void SetHolderProgram(const std::string& program);

class LeaseKeeper {
 public:
  // Acquires the lease if `source` says lease_required. FAILED_PRECONDITION names who holds it and how
  // to take it.
  static absl::StatusOr<std::unique_ptr<LeaseKeeper>> Acquire(Connection* connection,
                                                              const v1::DescribeResponse& source,
                                                              LeaseOptions options = {});
  // Gives the lease back; waits no longer than the window for an answer.
  ~LeaseKeeper();
  LeaseKeeper(const LeaseKeeper&) = delete;
  LeaseKeeper& operator=(const LeaseKeeper&) = delete;

  // Whether the source needs a lease.
  bool required() const { return required_; }
  // For lease_token of requests; empty where none is needed.
  std::string token() const;
  // OK while the lease is held, or none is needed; ABORTED says who took it, or that it ran out.
  absl::Status status() const;

  // After the connection was lost and found again: keeps the lease if it stands, else acquires a new one.
  // Never takes it from somebody else, and not where somebody stopped the source meanwhile
  // (FAILED_PRECONDITION): a new lease would end that stop.
  absl::Status Follow(Connection* connection);

 private:
  LeaseKeeper(LeaseOptions options, bool required) : options_(std::move(options)), required_(required) {}
  absl::Status AcquireNow(v1::Control::Stub* control, bool take);
  void Run();
  absl::Status Lost(v1::Control::Stub* control, const absl::Status& why) const;

  const LeaseOptions options_;
  const bool required_;
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  std::shared_ptr<v1::Control::Stub> control_;
  v1::Lease lease_;
  absl::Status status_;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace touchstone::client
