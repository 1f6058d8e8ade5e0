#include "server/service/core/metrics.h"

#include <prometheus/text_serializer.h>

#include <chrono>
#include <iterator>

#include "server/service/core/call_log.h"
#include "server/service/core/resources.h"
#include "server/service/options/access_roles.h"

namespace touchstone::service {
namespace {

// Upper bounds of the buckets of durations, s; one more has the rest.
const prometheus::Histogram::BucketBoundaries kDurations_s = {0.001, 0.0025, 0.01, 0.025, 0.1, 0.25,
                                                              1,     2.5,    10,   60,    600, 3600};

prometheus::MetricFamily Family(const char* name, const char* help, prometheus::MetricType type,
                                double value) {
  prometheus::MetricFamily family{name, help, type, {prometheus::ClientMetric()}};
  if (type == prometheus::MetricType::Counter)
    family.metric[0].counter.value = value;
  else
    family.metric[0].gauge.value = value;
  return family;
}

}  // namespace

CallMetrics::CallMetrics()
    : started_(prometheus::BuildCounter()
                   .Name("grpc_server_started_total")
                   .Help("Calls that began.")
                   .Register(registry_)),
      handled_(prometheus::BuildCounter()
                   .Name("grpc_server_handled_total")
                   .Help("Calls that ended, by status.")
                   .Register(registry_)),
      seconds_(prometheus::BuildHistogram()
                   .Name("grpc_server_handling_seconds")
                   .Help("How long calls took that were let in.")
                   .Register(registry_)) {
  const auto add = [this](const std::string& service, const std::string& method) {
    const prometheus::Labels labels = {{"grpc_service", service}, {"grpc_method", method}};
    methods_.push_back({labels, &started_.Add(labels), &seconds_.Add(labels, kDurations_s)});
    HandledOf(methods_.back(), grpc::StatusCode::OK);  // there with zero, so that a rate has a beginning
  };
  for (const MethodRole& row : MethodRoles()) {
    const std::string path = row.method;  // "/touchstone.v1.Source/Touch"
    const size_t slash = path.rfind('/');
    add(path.substr(1, slash - 1), path.substr(slash + 1));
  }
  add("other", "other");
}

const CallMetrics::OfMethod& CallMetrics::Find(absl::string_view method) const {
  for (size_t i = 0; i < MethodRoles().size(); ++i)
    if (method == MethodRoles()[i].method) return methods_[i];
  return methods_.back();
}

void CallMetrics::Started(absl::string_view method) {
  Find(method).started->Increment();
}

prometheus::Counter& CallMetrics::HandledOf(const OfMethod& method, int code) {
  prometheus::Labels labels = method.labels;
  labels["grpc_code"] = StatusCodeName(code);
  return handled_.Add(labels);
}

void CallMetrics::Handled(absl::string_view method, int code, double seconds) {
  const OfMethod& of = Find(method);
  HandledOf(of, code).Increment();
  of.seconds->Observe(seconds);
}

void CallMetrics::Refused(absl::string_view method, int code) {
  Started(method);
  HandledOf(Find(method), code).Increment();
}

std::string MetricsText(const Resources& resources) {
  std::vector<prometheus::MetricFamily> families;
  if (resources.calls != nullptr) families = resources.calls->Collect();
  const auto counter = [&](const char* name, const char* help, double value) {
    families.push_back(Family(name, help, prometheus::MetricType::Counter, value));
  };
  const auto gauge = [&](const char* name, const char* help, double value) {
    families.push_back(Family(name, help, prometheus::MetricType::Gauge, value));
  };
  counter("touchstone_samples_total", "Samples that datasets streamed.", resources.samples);
  counter("touchstone_touches_total", "Touches made or simulated, those of samples too.", resources.touches);
  counter("touchstone_images_total", "Photographs taken or rendered.", resources.images);
  gauge("touchstone_streams_active", "Dataset streams under way.", resources.running_streams);
  gauge("touchstone_requests_active", "Touches and captures under way.", resources.running_requests);
  gauge("touchstone_uploads_active", "Sessions that are being sent.", resources.uploads->taken());
  gauge("touchstone_diagnoses_active", "Sets that are compared, diagnosed or proposed for.",
        resources.diagnoses->taken());
  gauge("touchstone_queue", "Pieces of work that wait for a thread.",
        static_cast<double>(resources.pool->waiting()));
  gauge("touchstone_last_comparison_rmse_us",
        "Residual RMSE of the last comparison of touches; Nan: none yet.", resources.last_comparison_rmse_us);
  gauge("touchstone_draining", "1 while the process takes no more calls.", resources.draining ? 1 : 0);
  gauge("touchstone_uptime_seconds", "Since the process started.",
        std::chrono::duration<double>(std::chrono::steady_clock::now() - resources.started).count());
  gauge("touchstone_build_info", "Always 1; the version is a label.", 1);
  families.back().metric[0].label.push_back({"version", kVersion});
  return prometheus::TextSerializer().Serialize(families);
}

}  // namespace touchstone::service
