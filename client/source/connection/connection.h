// A connection to a source: over the network to one of several equal servers, or to a virtual source inside this
// process. Both are gRPC channels, so whatever runs over one runs over the other and gives the same bytes.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include <absl/status/statusor.h>
#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

#include "client/source/connection/credentials.h"
#include "client/source/connection/errors.h"
#include "client/source/connection/retry.h"
#include "server/base/threads/clock.h"
#include "server/service/options/server_options.h"
#include "server/service/rpc/server.h"
#include "touchstone/v1/control.grpc.pb.h"
#include "touchstone/v1/diagnosis.grpc.pb.h"
#include "touchstone/v1/models.grpc.pb.h"
#include "touchstone/v1/rig.grpc.pb.h"
#include "touchstone/v1/sessions.grpc.pb.h"
#include "touchstone/v1/source.grpc.pb.h"

namespace touchstone::client {

// "virtual" or "physical", as people and scripts read it.
inline const char* SourceKindName(v1::SourceKind kind) {
  return kind == v1::SOURCE_KIND_PHYSICAL  ? "physical"
         : kind == v1::SOURCE_KIND_VIRTUAL ? "virtual"
                                           : "unknown";
}

// The largest message that a client accepts: a batch of images goes well beyond gRPC's 4 MiB.
inline constexpr int kMaxMessageBytes = 256 << 20;

struct ConnectionOptions {
  std::vector<std::string> servers;      // "host:port"; tried in this order; none: a source in this process
  Credentials credentials;               // what they are shown
  service::ServerOptions embedded;       // of the source in this process; `listen` is ignored
  double connect_timeout_s = kConnectS;  // for one server
  double wait_s = 0;                // Open tries again for so long while none answers: one may be starting
  double retry_for_s = kRetryForS;  // a server that was lost later
  const Clock* clock = &SteadyClock();          // of the waits between two attempts; outlives the connection
  std::function<void(const std::string&)> log;  // what is waited for, and lost servers; may be null
};

// How one thing is tried again. What is not set here is that of the connection.
struct RetryOptions {
  std::optional<double> retry_for_s;
  const Clock* clock = nullptr;
  std::function<bool(double seconds)> wait;  // false: nobody wants it any more
  std::function<void(const std::string&)> log;
};

// Not safe for use by several threads at once, apart from the stubs, which are.
class Connection {
 public:
  // Connects to the first server that answers, or starts a source in this process. UNAVAILABLE names every
  // server that was tried, after `wait_s`; INVALID_ARGUMENT at once where one answers that these credentials do not fit.
  static absl::StatusOr<std::unique_ptr<Connection>> Open(ConnectionOptions options);
  ~Connection();

  v1::Source::Stub& source() { return *source_; }
  v1::Models::Stub& models() { return *models_; }
  v1::Control::Stub& control() { return *control_; }
  v1::Sessions::Stub& sessions() { return *sessions_; }
  v1::Diagnosis::Stub& diagnosis() { return *diagnosis_; }
  // Served by physical sources only; UNIMPLEMENTED elsewhere.
  v1::Rig::Stub& rig() { return *rig_; }
  const std::shared_ptr<grpc::Channel>& channel() const { return channel_; }

  // "127.0.0.1:50051", or "this process".
  const std::string& address() const { return address_; }
  bool embedded() const { return server_ != nullptr; }
  int server_count() const { return static_cast<int>(options_.servers.size()); }

  // Connects to the next server that answers, beginning after the present one; the present one is the last
  // that is tried. For a source in this process: an error, since it cannot be lost.
  absl::Status ConnectToNext();

  // One unary call, made again where it was lost: connection.Call(&v1::Source::Stub::Describe, request).
  template <typename Stub, typename Request, typename Response>
  absl::StatusOr<Response> Call(grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                                const Request& request) {
    absl::StatusOr<Response> response;
    const absl::Status status = Retrying([&] {
      response = CallOnce(method, request);
      return LostWhereCancelled(response.status());
    });
    if (!status.ok()) return status;
    return response;
  }
  // For what may not be done twice (deletions, the release of a stop), and for a rig's checks, where UNAVAILABLE says that its
  // arm is not there.
  template <typename Stub, typename Request, typename Response>
  absl::StatusOr<Response> CallOnce(grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&,
                                                                 Response*),
                                    const Request& request) {
    grpc::ClientContext context;
    Response response;
    const absl::Status status = FromGrpc((StubOf<Stub>().*method)(&context, request, &response));
    if (!status.ok()) return status;
    return response;
  }

  // Runs `attempt`, and again at the next server, while it is lost or full, as retry.h says; the last status. A loss that the
  // caller found goes in as `lost`.
  absl::Status Retrying(const std::function<absl::Status()>& attempt, const RetryOptions& options = {});
  absl::Status RetryingAfter(absl::Status lost, const std::function<absl::Status()>& attempt,
                             const RetryOptions& options = {});

 private:
  Connection() = default;
  template <typename Stub>
  Stub& StubOf() {
    if constexpr (std::is_same_v<Stub, v1::Source::Stub>) return *source_;
    if constexpr (std::is_same_v<Stub, v1::Models::Stub>) return *models_;
    if constexpr (std::is_same_v<Stub, v1::Control::Stub>) return *control_;
    if constexpr (std::is_same_v<Stub, v1::Sessions::Stub>) return *sessions_;
    if constexpr (std::is_same_v<Stub, v1::Diagnosis::Stub>) return *diagnosis_;
    if constexpr (std::is_same_v<Stub, v1::Rig::Stub>) return *rig_;
  }
  absl::Status Connect(int server_index);
  absl::Status ConnectToOneThatStarts();
  void MakeStubs();

  ConnectionOptions options_;
  std::unique_ptr<service::Server> server_;  // in this process; outlives the channel
  int server_index_ = 0;
  std::string address_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::Source::Stub> source_;
  std::unique_ptr<v1::Models::Stub> models_;
  std::unique_ptr<v1::Control::Stub> control_;
  std::unique_ptr<v1::Sessions::Stub> sessions_;
  std::unique_ptr<v1::Diagnosis::Stub> diagnosis_;
  std::unique_ptr<v1::Rig::Stub> rig_;
};

}  // namespace touchstone::client
