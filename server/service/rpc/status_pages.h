// Plain HTTP beside gRPC, for what cannot speak gRPC: Prometheus and probes. GET of
//   /metrics  metrics.h
//   /livez    200 if this process still answers a gRPC call of its own within 5 s, else 503: start it anew
//   /readyz   200 if it takes calls, 503 while it drains: send them elsewhere
#pragma once

#include <memory>
#include <mutex>
#include <string>

#include <absl/status/statusor.h>
#include <grpcpp/channel.h>

namespace touchstone::service {

struct Resources;

class StatusPages {
 public:
  // At "HOST:PORT", or ":PORT" of this machine alone; port 0: any free one. INVALID_ARGUMENT or UNAVAILABLE names the
  // option. `resources` outlives it; `channel` goes to the server inside of this process.
  static absl::StatusOr<std::unique_ptr<StatusPages>> Start(const std::string& address,
                                                            const Resources* resources,
                                                            std::shared_ptr<grpc::Channel> channel);
  ~StatusPages();
  StatusPages(const StatusPages&) = delete;
  StatusPages& operator=(const StatusPages&) = delete;
  int port() const;
  // To be called before the server shuts down: a call inside of the process to a server that has ends the process (gRPC
  // 1.51). Returns when none is under way; from now on the process is alive and not ready.
  void StopAsking();

 private:
  struct Page {
    unsigned status;  // of HTTP
    std::string text;
  };
  class Http;
  class Connection;
  StatusPages(const Resources* resources, std::shared_ptr<grpc::Channel> channel);
  Page PageAt(const std::string& path) const;
  Page Liveness() const;
  Page Readiness() const;

  const Resources* const resources_;
  const std::shared_ptr<grpc::Channel> channel_;
  mutable std::mutex asking_mutex_;  // held while the server is asked
  bool asking_ = true;               // guarded by it
  std::unique_ptr<Http> http_;
};

}  // namespace touchstone::service
