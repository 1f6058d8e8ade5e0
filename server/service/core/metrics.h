// What a process counts for Prometheus.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/strings/string_view.h>
#include <grpcpp/support/server_interceptor.h>
#include <prometheus/counter.h>
#include <prometheus/family.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>

namespace touchstone::service {

struct Resources;

// Calls by method: grpc_server_started_total, grpc_server_handled_total, grpc_server_handling_seconds, as other gRPC servers
// name them. Thread-safe. Methods are those of access_roles.h and "other", so that nobody makes new series by calling what
// is not there.
class CallMetrics {
 public:
  CallMetrics();
  void Started(absl::string_view method);
  // `code` as gRPC numbers it; another one counts as UNKNOWN.
  void Handled(absl::string_view method, int code, double seconds);
  // Refused before it was read: started and handled, but it has no duration.
  void Refused(absl::string_view method, int code);
  std::vector<prometheus::MetricFamily> Collect() const { return registry_.Collect(); }

 private:
  struct OfMethod {
    prometheus::Labels labels;
    prometheus::Counter* started;
    prometheus::Histogram* seconds;
  };
  const OfMethod& Find(absl::string_view method) const;
  prometheus::Counter& HandledOf(const OfMethod& method, int code);

  prometheus::Registry registry_;
  prometheus::Family<prometheus::Counter>&started_, &handled_;
  prometheus::Family<prometheus::Histogram>& seconds_;
  std::vector<OfMethod> methods_;  // the last one: every other
};

// In Prometheus's text format: the calls, and touchstone_*: samples, touches, images, what runs and waits, the error of the
// last comparison.
std::string MetricsText(const Resources& resources);

}  // namespace touchstone::service
