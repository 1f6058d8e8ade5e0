#include "server/service/calls/request_guard.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <google/protobuf/io/zero_copy_stream.h>
#include <grpc/byte_buffer.h>
#include <grpc/byte_buffer_reader.h>
#include <grpc/grpc.h>
#include <grpc/slice.h>
#include <grpc/support/alloc.h>
#include <grpcpp/impl/rpc_service_method.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <unordered_map>
#include <vector>

#include "server/base/status.h"
#include "server/base/text/over_limit.h"
#include "server/service/calls/wire_count.h"
#include "server/service/core/convert.h"
#include "server/service/options/limits.h"

namespace touchstone::service {
namespace {

using grpc::internal::MethodHandler;
using grpc::internal::RpcServiceMethod;
using Methods = std::vector<std::unique_ptr<RpcServiceMethod>>;

// A synchronous service of gRPC gets its requests decoded, and a handler cannot be set without making the method another
// kind of one. So its private handlers are reached through explicit instantiation, which may name private members.
template <typename Tag, typename Tag::Type member>
struct Reach {
  friend typename Tag::Type MemberOf(Tag) { return member; }
};
struct MethodsOfService {
  using Type = Methods grpc::Service::*;
  friend Type MemberOf(MethodsOfService);
};
struct HandlerOfMethod {
  using Type = std::unique_ptr<MethodHandler> RpcServiceMethod::*;
  friend Type MemberOf(HandlerOfMethod);
};
template struct Reach<MethodsOfService, &grpc::Service::methods_>;
template struct Reach<HandlerOfMethod, &RpcServiceMethod::handler_>;

// What a message or a text, and a number, take when they are decoded and made into what the program works with, about.
constexpr uint64_t kBytesOfElement = 256, kBytesOfNumber = 16;

// The bytes of a message as protobuf reads them, without a copy.
class BufferStream : public google::protobuf::io::ZeroCopyInputStream {
 public:
  explicit BufferStream(grpc_byte_buffer* buffer) : good_(grpc_byte_buffer_reader_init(&reader_, buffer)) {}
  ~BufferStream() override {
    if (good_) grpc_byte_buffer_reader_destroy(&reader_);
  }
  bool Next(const void** data, int* size) override {
    if (back_ > 0) {
      *data = GRPC_SLICE_END_PTR(*slice_) - back_;
      *size = static_cast<int>(back_);
      back_ = 0;
    } else {
      if (!good_ || !grpc_byte_buffer_reader_peek(&reader_, &slice_)) return false;
      *data = GRPC_SLICE_START_PTR(*slice_);
      *size = static_cast<int>(GRPC_SLICE_LENGTH(*slice_));
    }
    bytes_ += *size;
    return true;
  }
  void BackUp(int count) override {
    back_ = count;
    bytes_ -= count;
  }
  bool Skip(int count) override {
    const void* data = nullptr;
    int size = 0;
    while (count > 0 && Next(&data, &size)) {
      if (size > count) BackUp(size - count);
      count -= std::min(size, count);
    }
    return count == 0;
  }
  int64_t ByteCount() const override { return bytes_; }

 private:
  grpc_byte_buffer_reader reader_;
  const bool good_;
  grpc_slice* slice_ = nullptr;
  size_t back_ = 0;
  int64_t bytes_ = 0;
};

class GuardedHandler : public MethodHandler {
 public:
  GuardedHandler(std::unique_ptr<MethodHandler> handler, const google::protobuf::MethodDescriptor& method,
                 const Limits* limits, MemoryBudget* memory, CallRate* rate)
      : handler_(std::move(handler)),
        request_(*method.input_type()),
        limits_(*limits),
        memory_(memory),
        rate_(rate) {
    const std::string& service = method.service()->name();
    large_ = service == "Diagnosis" || service == "Sessions";
    needs_memory_ = service != "Control" && service != "Rig" && service != "Freedrive";
    counts_ = needs_memory_ && !method.server_streaming();
  }

  void* Deserialize(grpc_call* call, grpc_byte_buffer* buffer, grpc::Status* status,
                    void** handler_data) override {
    // Whoever hangs up, or ends its side, before the message came sent none.
    if (buffer == nullptr)
      return Refuse(absl::InvalidArgumentError("the call ended before its request came: send one message"),
                    nullptr, status);
    if (counts_)
      if (const absl::Status taken = rate_->Take(ClientOfCall(call)); !taken.ok())
        return Refuse(taken, buffer, status);
    absl::StatusOr<uint64_t> bytes = Measure(buffer);
    if (!bytes.ok()) return Refuse(bytes.status(), buffer, status);
    std::optional<MemoryBudget::Reservation> reservation;
    if (needs_memory_) {
      auto reserved = memory_->Reserve(*bytes);
      if (!reserved.ok()) return Refuse(reserved.status(), buffer, status);
      reservation.emplace(*std::move(reserved));
    }
    try {
      void* request = handler_->Deserialize(call, buffer, status, handler_data);
      if (request == nullptr || !reservation.has_value()) return request;
      std::lock_guard<std::mutex> lock(mutex_);
      reservations_.emplace(request, *std::move(reservation));
      return request;
    } catch (const std::bad_alloc&) {
      *status = ToGrpc(NoMemoryFor("request"));
      return nullptr;
    }
  }

  void RunHandler(const HandlerParameter& parameter) override {
    handler_->RunHandler(parameter);
    std::lock_guard<std::mutex> lock(mutex_);
    reservations_.erase(parameter.request);
  }

 private:
  static std::string ClientOfCall(grpc_call* call) {
    char* const peer = grpc_call_get_peer(call);
    const std::string client = ClientOfPeer(peer == nullptr ? "" : peer);
    gpr_free(peer);
    return client;
  }

  static void* Refuse(const absl::Status& why, grpc_byte_buffer* buffer, grpc::Status* status) {
    *status = ToGrpc(why);
    grpc_byte_buffer_destroy(buffer);
    return nullptr;
  }

  absl::StatusOr<uint64_t> Measure(grpc_byte_buffer* buffer) const {
    BufferStream stream(buffer);
    return MeasureRequest(request_, grpc_byte_buffer_length(buffer), &stream, limits_, large_);
  }

  const std::unique_ptr<MethodHandler> handler_;
  const google::protobuf::Descriptor& request_;
  const Limits& limits_;
  MemoryBudget* const memory_;
  CallRate* const rate_;
  bool large_ = false, needs_memory_ = false, counts_ = false;
  std::mutex mutex_;
  std::unordered_map<void*, MemoryBudget::Reservation> reservations_;  // by the decoded request
};

}  // namespace

absl::StatusOr<uint64_t> MeasureRequest(const google::protobuf::Descriptor& request, size_t bytes,
                                        google::protobuf::io::ZeroCopyInputStream* stream,
                                        const Limits& limits, bool large) {
  const size_t max_mib = large ? limits.max_upload_mib : limits.max_request_mib;
  if (bytes > max_mib * kMebibyte)
    return OverLimit(absl::StrCat(request.name(), " has bytes:"), bytes,
                     large ? "max_upload_mib" : "max_request_mib", max_mib * kMebibyte);
  WireCount count;
  google::protobuf::io::CodedInputStream input(stream);
  input.SetTotalBytesLimit(INT32_MAX);
  CountWire(&input, &request, &count);  // what is not a message is refused when it is decoded
  const auto check = [&](const char* what, uint64_t has, const char* name, int max) {
    return has <= static_cast<uint64_t>(max)
               ? absl::OkStatus()
               : OverLimit(absl::StrCat(request.name(), " has ", what, ":"), has, name, max);
  };
  TOUCHSTONE_RETURN_IF_ERROR(check("touches", count.Messages("touchstone.v1.CommandedTouch"),
                                   "max_touches_per_request", limits.max_touches_per_request));
  TOUCHSTONE_RETURN_IF_ERROR(
      check("messages and texts", count.elements, "max_request_elements", limits.max_request_elements));
  TOUCHSTONE_RETURN_IF_ERROR(
      check("numbers", count.numbers, "max_request_numbers", limits.max_request_numbers));
  return bytes + count.elements * kBytesOfElement + count.numbers * kBytesOfNumber;
}

void GuardRequests(grpc::Service* service, const Limits* limits, MemoryBudget* memory, CallRate* rate) {
  for (const std::unique_ptr<RpcServiceMethod>& method : service->*MemberOf(MethodsOfService())) {
    if (method->method_type() != grpc::internal::RpcMethod::NORMAL_RPC &&
        method->method_type() != grpc::internal::RpcMethod::SERVER_STREAMING)
      continue;
    // "/touchstone.v1.Source/Touch".
    const std::string name = absl::StrReplaceAll(method->name() + 1, {{"/", "."}});
    const auto* descriptor = google::protobuf::DescriptorPool::generated_pool()->FindMethodByName(name);
    if (descriptor == nullptr) continue;
    std::unique_ptr<MethodHandler>& handler = (*method).*MemberOf(HandlerOfMethod());
    if (handler == nullptr) continue;  // of a call queue, which looks itself (call_queue.h)
    handler = std::make_unique<GuardedHandler>(std::move(handler), *descriptor, limits, memory, rate);
  }
}

}  // namespace touchstone::service
