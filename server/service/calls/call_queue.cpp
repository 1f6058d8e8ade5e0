#include "server/service/calls/call_queue.h"

#include <grpcpp/impl/codegen/proto_utils.h>
#include <grpcpp/support/proto_buffer_reader.h>

#include "server/service/calls/request_guard.h"
#include "server/service/core/convert.h"

namespace touchstone::service {

// One call, from when it is waited for to the last byte of its answer.
class CallQueue::Call {
 public:
  Call(const Method& method, CallQueue* owner) : method_(method), owner_(owner) {
    method_.ask(&context_, &request_, &writer_, owner_->queue_.get(), this);
  }
  // Whether it is still needed.
  bool Proceed(bool ok) {
    if (!ok || answered_ || !BeginAnswer()) return false;
    answered_ = true;
    CallQueue* const owner = owner_;
    grpc::ByteBuffer response;
    const grpc::Status status = method_.answer(&context_, request_, &response);
    if (status.ok())
      writer_.Finish(response, status, this);
    else
      writer_.FinishWithError(status, this);
    EndAnswer(owner);
    return true;
  }

 private:
  // The next call of the method is waited for meanwhile.
  bool BeginAnswer() {
    const std::lock_guard<std::mutex> lock(owner_->mutex_);
    if (owner_->ending_) return false;
    ++owner_->answering_;
    new Call(method_, owner_);  // the queue gives it back, as this one
    return true;
  }
  // The call itself may be gone already.
  static void EndAnswer(CallQueue* owner) {
    const std::lock_guard<std::mutex> lock(owner->mutex_);
    --owner->answering_;
    owner->answered_.notify_all();
  }

  const Method& method_;
  CallQueue* const owner_;
  grpc::ServerContext context_;
  grpc::ByteBuffer request_;
  grpc::ServerAsyncResponseWriter<grpc::ByteBuffer> writer_{&context_};
  bool answered_ = false;
};

// The queue's threads do not carry other connections' bytes.
CallQueue::CallQueue(grpc::ServerBuilder* builder, int threads, std::vector<Method> methods)
    : methods_(std::move(methods)),
      count_(threads),
      queue_(builder->AddCompletionQueue(/*is_frequently_polled=*/false)) {}

CallQueue::~CallQueue() {
  {
    std::unique_lock<std::mutex> lock(mutex_);
    ending_ = true;
    answered_.wait(lock, [this] { return answering_ == 0; });
  }
  queue_->Shutdown();
  if (threads_.empty()) threads_.emplace_back([this] { Run(); });
  for (std::thread& thread : threads_) thread.join();
}

void CallQueue::Begin() {
  for (const Method& method : methods_)
    for (size_t k = 0; k < count_; ++k) new Call(method, this);
  for (size_t k = 0; k < count_; ++k) threads_.emplace_back([this] { Run(); });
}

void CallQueue::Run() {
  void* tag = nullptr;
  for (bool ok = false; queue_->Next(&tag, &ok);) {
    const auto call = static_cast<Call*>(tag);
    if (!call->Proceed(ok)) delete call;
  }
}

grpc::Status ReadRequest(const grpc::ByteBuffer& bytes, const Limits& limits,
                         google::protobuf::Message* request) {
  grpc::ByteBuffer copy = bytes;  // shares them
  grpc::ProtoBufferReader looked_at(&copy);
  const absl::StatusOr<uint64_t> measured =
      MeasureRequest(*request->GetDescriptor(), copy.Length(), &looked_at, limits, /*large=*/false);
  if (!measured.ok()) return ToGrpc(measured.status());
  return grpc::GenericDeserialize<grpc::ProtoBufferReader, google::protobuf::Message>(&copy, request);
}

grpc::Status WriteResponse(const google::protobuf::Message& response, grpc::ByteBuffer* bytes) {
  bool own = false;
  return grpc::GenericSerialize<grpc::ProtoBufferWriter, google::protobuf::Message>(response, bytes, &own);
}

}  // namespace touchstone::service
