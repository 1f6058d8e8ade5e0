#include "client/workbench_server/bridge.h"

#include <grpcpp/client_context.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/support/byte_buffer.h>

#include <chrono>
#include <optional>
#include <utility>
#include <vector>

#include <boost/beast/http/field.hpp>
#include <boost/beast/http/verb.hpp>

#include "client/workbench_server/grpc_web.h"

namespace touchstone::workbench {
namespace {

namespace http = boost::beast::http;

HttpFields AnswerFields() {
  HttpFields fields;
  fields.set(http::field::content_type, kGrpcWebType);
  return fields;
}

std::string Bytes(const grpc::ByteBuffer& buffer) {
  std::vector<grpc::Slice> slices;
  std::string bytes;
  if (!buffer.Dump(&slices).ok()) return bytes;
  bytes.reserve(buffer.Length());
  for (const grpc::Slice& slice : slices)
    bytes.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
  return bytes;
}

// One call; deletes itself when it is done. A message is read when the one before was taken, so that a slow page slows the
// server down and fills no memory.
class Call : public grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
 public:
  Call(std::shared_ptr<grpc::Channel> channel, std::shared_ptr<Exchange> exchange)
      : stub_(std::move(channel)), exchange_(std::move(exchange)) {}

  // The exchange's handler may outlive the call: it holds what can be cancelled.
  void Start(absl::string_view message, std::optional<std::chrono::nanoseconds> timeout) {
    if (timeout)
      context_->set_deadline(std::chrono::system_clock::now() +
                             std::chrono::duration_cast<std::chrono::system_clock::duration>(*timeout));
    const grpc::Slice slice(message.data(), message.size());
    request_ = grpc::ByteBuffer(&slice, 1);
    stub_.PrepareBidiStreamingCall(context_.get(), std::string(exchange_->request().target()), {}, this);
    AddHold();  // for reads that begin outside of reactions
    StartWriteLast(&request_, grpc::WriteOptions());
    StartRead(&response_);
    exchange_->OnGone([context = context_] { context->TryCancel(); });
    StartCall();
  }

  void OnReadDone(bool ok) override {
    if (!ok) return RemoveHold();
    BeginAnswer();
    exchange_->Write(MessageFrame(Bytes(response_)), [this](bool taken) {
      if (!taken) return context_->TryCancel(), RemoveHold();
      StartRead(&response_);
    });
  }

  void OnDone(const grpc::Status& status) override {
    BeginAnswer();
    exchange_->Write(TrailersFrame(status, context_->GetServerTrailingMetadata()),
                     [exchange = exchange_](bool taken) {
                       if (taken) exchange->End();
                     });
    delete this;
  }

 private:
  void BeginAnswer() {
    if (std::exchange(begun_, true)) return;
    HttpFields fields = AnswerFields();
    for (const auto& [key, value] : context_->GetServerInitialMetadata()) {
      const std::string name(key.data(), key.size());
      fields.insert(name, HeaderValue(name, {value.data(), value.size()}));
    }
    exchange_->Begin(std::move(fields));
  }

  grpc::GenericStub stub_;
  const std::shared_ptr<Exchange> exchange_;
  const std::shared_ptr<grpc::ClientContext> context_ = std::make_shared<grpc::ClientContext>();
  grpc::ByteBuffer request_, response_;
  bool begun_ = false;
};

// A call that never began: the status stands in the head, and there is no body.
void ReplyNoCall(Exchange* exchange, const absl::Status& status) {
  HttpFields fields = AnswerFields();
  fields.set("grpc-status", std::to_string(static_cast<int>(status.code())));
  fields.set("grpc-message", PercentEncoded(status.message()));
  exchange->Reply(200, std::move(fields), "");
}

}  // namespace

bool IsGrpcWeb(const HttpRequest& request) {
  const auto type = request[http::field::content_type];
  return request.method() == http::verb::post && IsGrpcWebType({type.data(), type.size()});
}

void ForwardCall(std::shared_ptr<grpc::Channel> channel, std::shared_ptr<Exchange> exchange) {
  const HttpRequest& request = exchange->request();
  absl::Status status = CheckMethod({request.target().data(), request.target().size()});
  if (!status.ok()) return ReplyNoCall(exchange.get(), status);
  const absl::StatusOr<absl::string_view> message = OneMessage(request.body());
  if (!message.ok()) return ReplyNoCall(exchange.get(), message.status());
  std::optional<std::chrono::nanoseconds> timeout;
  if (const auto text = request["grpc-timeout"]; !text.empty()) {
    timeout = ParseTimeout({text.data(), text.size()});
    if (!timeout)
      return ReplyNoCall(exchange.get(),
                         absl::InvalidArgumentError(
                             "grpc-timeout: up to eight digits and one of H M S m u n were expected"));
  }
  (new Call(std::move(channel), exchange))->Start(*message, timeout);
}

}  // namespace touchstone::workbench
