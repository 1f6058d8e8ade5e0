#include "client/workbench_server/http/bridge.h"

#include <grpcpp/client_context.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/support/byte_buffer.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <optional>
#include <utility>
#include <vector>

#include <boost/beast/http/field.hpp>
#include <boost/beast/http/verb.hpp>

#include "client/source/connection/errors.h"
#include "client/workbench_server/http/grpc_web.h"

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

// A call that never began: the status stands in the head, and there is no body.
void ReplyNoCall(Exchange* exchange, const absl::Status& status) {
  HttpFields fields = AnswerFields();
  fields.set("grpc-status", std::to_string(static_cast<int>(status.code())));
  fields.set("grpc-message", PercentEncoded(status.message()));
  exchange->Reply(200, std::move(fields), "");
}

// One call; deletes itself when it is done. A message is read when the one before was taken, so that a slow page slows the
// server down and fills no memory.
class Call : public grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
 public:
  Call(std::shared_ptr<Upstream> upstream, std::shared_ptr<Exchange> exchange, int servers_left)
      : upstream_(std::move(upstream)),
        server_(upstream_->server()),
        stub_(server_.channel),
        exchange_(std::move(exchange)),
        servers_left_(servers_left) {}

  // The exchange's handler may outlive the call: it holds what can be cancelled.
  void Start(absl::string_view message, std::optional<std::chrono::nanoseconds> timeout) {
    timeout_ = timeout;
    if (timeout)
      context_->set_deadline(std::chrono::system_clock::now() +
                             std::chrono::duration_cast<std::chrono::system_clock::duration>(*timeout));
    const grpc::Slice slice(message.data(), message.size());
    request_ = grpc::ByteBuffer(&slice, 1);
    stub_.PrepareBidiStreamingCall(context_.get(), std::string(exchange_->request().target()), {}, this);
    AddHold();  // for reads that begin outside of reactions
    StartWriteLast(&request_, grpc::WriteOptions());
    StartRead(&response_);
    exchange_->OnGone([context = context_, gone = gone_] {
      *gone = true;
      context->TryCancel();
    });
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
    // A server that ends cancels its calls: nobody here did.
    const bool lost = !*gone_ && upstream_->server_count() > 0 &&
                      client::IsLostServer(client::LostWhereCancelled(client::FromGrpc(status)));
    if (lost && !begun_ && servers_left_ > 0) return Again();
    Finish(lost ? grpc::Status(grpc::StatusCode::UNAVAILABLE, status.error_message()) : status);
  }

 private:
  void Finish(const grpc::Status& status) {
    BeginAnswer();
    exchange_->Write(TrailersFrame(status, context_->GetServerTrailingMetadata()),
                     [exchange = exchange_](bool taken) {
                       if (taken) exchange->End();
                     });
    delete this;
  }

  // At the next server that answers.
  void Again() {
    upstream_->FindAnother(server_, [upstream = upstream_, exchange = exchange_, timeout = timeout_,
                                     left = servers_left_ - 1](const absl::Status& found) {
      const absl::StatusOr<absl::string_view> message = OneMessage(exchange->request().body());
      if (!found.ok() || !message.ok())
        return ReplyNoCall(exchange.get(), found.ok() ? message.status() : found);
      (new Call(upstream, exchange, left))->Start(*message, timeout);
    });
    delete this;
  }

  void BeginAnswer() {
    if (std::exchange(begun_, true)) return;
    HttpFields fields = AnswerFields();
    fields.set(kServerHeader, server_.address);
    for (const auto& [key, value] : context_->GetServerInitialMetadata()) {
      const std::string name(key.data(), key.size());
      fields.insert(name, HeaderValue(name, {value.data(), value.size()}));
    }
    exchange_->Begin(std::move(fields));
  }

  const std::shared_ptr<Upstream> upstream_;
  const Upstream::Server server_;
  grpc::GenericStub stub_;
  const std::shared_ptr<Exchange> exchange_;
  const int servers_left_;
  std::optional<std::chrono::nanoseconds> timeout_;
  const std::shared_ptr<std::atomic<bool>> gone_ = std::make_shared<std::atomic<bool>>(false);
  const std::shared_ptr<grpc::ClientContext> context_ = std::make_shared<grpc::ClientContext>();
  grpc::ByteBuffer request_, response_;
  bool begun_ = false;
};

}  // namespace

bool IsGrpcWeb(const HttpRequest& request) {
  const auto type = request[http::field::content_type];
  return request.method() == http::verb::post && IsGrpcWebType({type.data(), type.size()});
}

void ForwardCall(std::shared_ptr<Upstream> upstream, std::shared_ptr<Exchange> exchange) {
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
  const int others = std::max(0, upstream->server_count() - 1);
  (new Call(std::move(upstream), exchange, others))->Start(*message, timeout);
}

}  // namespace touchstone::workbench
