#include "server/service/core/call_log.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <openssl/rand.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <iterator>

#include "server/base/process/out_of_memory.h"
#include "server/base/text/over_limit.h"
#include "server/base/text/printable.h"
#include "server/service/core/access.h"
#include "server/service/core/convert.h"
#include "server/service/core/metrics.h"

namespace touchstone::service {
namespace {

constexpr const char* kCodes[] = {
    "OK",        "CANCELLED",      "UNKNOWN",           "INVALID_ARGUMENT",   "DEADLINE_EXCEEDED",
    "NOT_FOUND", "ALREADY_EXISTS", "PERMISSION_DENIED", "RESOURCE_EXHAUSTED", "FAILED_PRECONDITION",
    "ABORTED",   "OUT_OF_RANGE",   "UNIMPLEMENTED",     "INTERNAL",           "UNAVAILABLE",
    "DATA_LOSS", "UNAUTHENTICATED"};
constexpr char kRequestId[] = "x-request-id", kTraceParent[] = "traceparent";
constexpr size_t kMaxRequestIdBytes = 256, kMaxMethodBytes = 200;

std::string NewRequestId() {
  unsigned char bytes[8];
  RAND_bytes(bytes, sizeof bytes);
  std::string id;
  for (const unsigned char byte : bytes) absl::StrAppend(&id, absl::Hex(byte, absl::kZeroPad2));
  return id;
}

// It goes back as metadata and into the log: letters, digits and what ids are commonly made of.
bool IsRequestId(absl::string_view id) {
  return !id.empty() && id.size() <= kMaxRequestIdBytes && std::all_of(id.begin(), id.end(), [](char c) {
    return absl::ascii_isalnum(c) || c == '-' || c == '_' || c == '.' || c == ':' || c == '/';
  });
}

bool IsLowerHex(absl::string_view text) {
  return std::all_of(text.begin(), text.end(),
                     [](char c) { return absl::ascii_isdigit(c) || (c >= 'a' && c <= 'f'); });
}

// One call, from the first byte to the last.
class CallInterceptor : public grpc::experimental::Interceptor {
 public:
  CallInterceptor(CallMetrics* metrics, const std::string& method) : metrics_(metrics), method_(method) {
    if (metrics_ != nullptr) metrics_->Started(method_);
  }
  ~CallInterceptor() override {
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
    if (metrics_ != nullptr) metrics_->Handled(method_, code_, seconds);
    spdlog::debug("{}{} {} {} {:.1f} ms", id_, trace_id_.empty() ? "" : " trace " + trace_id_,
                  Printable(MethodName(method_), kMaxMethodBytes), StatusCodeName(code_), 1e3 * seconds);
  }

  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    using grpc::experimental::InterceptionHookPoints;
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::POST_RECV_INITIAL_METADATA)) {
      const auto* const metadata = methods->GetRecvInitialMetadata();
      const auto text = [&](const char* key) {
        const auto found = metadata->find(key);
        return found == metadata->end() ? absl::string_view()
                                        : absl::string_view(found->second.data(), found->second.size());
      };
      if (const absl::string_view given = text(kRequestId); IsRequestId(given)) id_ = std::string(given);
      trace_id_ = TraceIdOf(text(kTraceParent));
    }
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_INITIAL_METADATA))
      methods->GetSendInitialMetadata()->insert({kRequestId, id_});
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_STATUS)) {
      // gRPC makes UNKNOWN of whatever a handler throws.
      if (methods->GetSendStatus().error_code() == grpc::StatusCode::UNKNOWN &&
          OutOfMemoryCount() != out_of_memory_)
        methods->ModifySendStatus(ToGrpc(NoMemoryFor("call")));
      code_ = methods->GetSendStatus().error_code();
    }
    methods->Proceed();
  }

 private:
  CallMetrics* const metrics_;
  const std::string method_;
  const std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  const uint64_t out_of_memory_ = OutOfMemoryCount();
  std::string id_ = NewRequestId(), trace_id_;
  int code_ = grpc::StatusCode::CANCELLED;  // until there is another to send
};

class CallInterceptors : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  explicit CallInterceptors(CallMetrics* metrics) : metrics_(metrics) {}
  grpc::experimental::Interceptor* CreateServerInterceptor(grpc::experimental::ServerRpcInfo* info) override {
    return new CallInterceptor(metrics_, info->method());
  }

 private:
  CallMetrics* const metrics_;
};

}  // namespace

const char* StatusCodeName(int code) {
  const bool known = code >= 0 && code < static_cast<int>(std::size(kCodes));
  return kCodes[known ? code : grpc::StatusCode::UNKNOWN];
}

std::string TraceIdOf(absl::string_view traceparent) {
  // version "-" trace-id "-" parent-id "-" flags; later versions may have more behind another "-".
  constexpr size_t kTraceAt = 3, kTraceDigits = 32, kParentAt = 36, kParentDigits = 16, kFlagsAt = 53,
                   kBytes = 55;
  if (traceparent.size() < kBytes) return "";
  const absl::string_view version = traceparent.substr(0, 2), id = traceparent.substr(kTraceAt, kTraceDigits),
                          parent = traceparent.substr(kParentAt, kParentDigits);
  const bool separated = traceparent[2] == '-' && traceparent[kParentAt - 1] == '-' &&
                         traceparent[kFlagsAt - 1] == '-' &&
                         (traceparent.size() == kBytes || (version != "00" && traceparent[kBytes] == '-'));
  const auto zero = [](absl::string_view digits) {
    return digits.find_first_not_of('0') == absl::string_view::npos;
  };
  const bool valid = separated && IsLowerHex(version) && version != "ff" && IsLowerHex(id) && !zero(id) &&
                     IsLowerHex(parent) && !zero(parent) && IsLowerHex(traceparent.substr(kFlagsAt, 2));
  return valid ? std::string(id) : "";
}

std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> MakeCallInterceptors(
    CallMetrics* metrics) {
  return std::make_unique<CallInterceptors>(metrics);
}

}  // namespace touchstone::service
