// Unary methods whose calls wait in a queue of their own and are answered by threads of their own, so that no call of another
// method can keep them waiting: gRPC's synchronous methods share one queue and at most max_threads threads.
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include <google/protobuf/message.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/support/async_unary_call.h>

#include "server/service/options/limits.h"

namespace touchstone::service {

class CallQueue {
 public:
  // Has gRPC put the next call of a method in there: a method of a generated service, RequestStop of
  // WithRawMethod_Stop<...>.
  using Ask = std::function<void(grpc::ServerContext*, grpc::ByteBuffer* request,
                                 grpc::ServerAsyncResponseWriter<grpc::ByteBuffer>*,
                                 grpc::ServerCompletionQueue*, void* tag)>;
  // Answers a call; several at once.
  using Answer =
      std::function<grpc::Status(grpc::ServerContext*, const grpc::ByteBuffer& request, grpc::ByteBuffer*)>;
  struct Method {
    Ask ask;
    Answer answer;
  };

  // Before the server starts. `threads`: calls that are answered at once.
  CallQueue(grpc::ServerBuilder* builder, int threads, std::vector<Method> methods);
  // After the server was shut down, before it is destroyed.
  ~CallQueue();
  // Once the server has started.
  void Begin();

 private:
  class Call;
  void Run();

  const std::vector<Method> methods_;
  const size_t count_;  // of threads
  std::unique_ptr<grpc::ServerCompletionQueue> queue_;
  std::mutex mutex_;
  std::condition_variable answered_;
  bool ending_ = false;   // guarded by mutex_; then nothing is put into the queue any more
  size_t answering_ = 0;  // guarded by mutex_
  std::vector<std::thread> threads_;
};

// The method `answer` of `service`, whose request is looked at as those of other methods are (request_guard.h). Both outlive
// the queue.
template <typename Service, typename Ask, typename Request, typename Response>
CallQueue::Method RawMethod(Service* service, Ask ask, const Limits* limits,
                            grpc::Status (Service::*answer)(grpc::ServerContext*, const Request*, Response*));

// What a request becomes, or RESOURCE_EXHAUSTED with the name of the limit; INTERNAL if it is none.
grpc::Status ReadRequest(const grpc::ByteBuffer& bytes, const Limits& limits,
                         google::protobuf::Message* request);
grpc::Status WriteResponse(const google::protobuf::Message& response, grpc::ByteBuffer* bytes);

template <typename Service, typename Ask, typename Request, typename Response>
CallQueue::Method RawMethod(Service* service, Ask ask, const Limits* limits,
                            grpc::Status (Service::*answer)(grpc::ServerContext*, const Request*,
                                                            Response*)) {
  return {[service, ask](grpc::ServerContext* context, grpc::ByteBuffer* request,
                         grpc::ServerAsyncResponseWriter<grpc::ByteBuffer>* writer,
                         grpc::ServerCompletionQueue* queue,
                         void* tag) { (service->*ask)(context, request, writer, queue, queue, tag); },
          [service, answer, limits](grpc::ServerContext* context, const grpc::ByteBuffer& bytes,
                                    grpc::ByteBuffer* answered) {
            Request request;
            Response response;
            grpc::Status status = ReadRequest(bytes, *limits, &request);
            if (status.ok()) status = (service->*answer)(context, &request, &response);
            return status.ok() ? WriteResponse(response, answered) : status;
          }};
}

}  // namespace touchstone::service
