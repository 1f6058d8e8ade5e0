#include "client/workbench_server/http/http_server.h"

#include <absl/strings/str_cat.h>

#include <boost/asio/bind_executor.hpp>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>

#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "client/workbench_server/http/request_guard.h"
#include "server/base/process/tcp_listen.h"

namespace touchstone::workbench {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using tcp = boost::asio::ip::tcp;

constexpr int kThreads = 4;
constexpr std::chrono::milliseconds kPause{200};
constexpr double kDrainS = 1;  // for what a refused client still sends

std::chrono::milliseconds Milliseconds(double seconds) {
  return std::chrono::milliseconds(static_cast<int64_t>(1e3 * seconds));
}

unsigned HttpStatus(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kPermissionDenied:
      return 403;
    case absl::StatusCode::kUnauthenticated:
      return 401;
    case absl::StatusCode::kNotFound:
      return 404;
    case absl::StatusCode::kResourceExhausted:
      return 413;
    case absl::StatusCode::kUnavailable:
      return 503;
    case absl::StatusCode::kInternal:
      return 500;
    default:
      return 400;
  }
}

// What every answer says: nothing is guessed, kept, framed or told to others.
void SetCommon(HttpFields* fields) {
  fields->set(http::field::cache_control, "no-store");
  fields->set("X-Content-Type-Options", "nosniff");
  fields->set("X-Frame-Options", "DENY");
  fields->set("Referrer-Policy", "no-referrer");
  fields->set("Cross-Origin-Resource-Policy", "same-origin");
}

class Connection;

// Connections that are under way: how many may be, and how all end.
class Registry {
 public:
  bool Add(Connection* connection, std::weak_ptr<Connection> weak, size_t limit) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (stopping_ || open_.size() >= limit) return false;
    open_.emplace(connection, std::move(weak));
    return true;
  }
  void Remove(Connection* connection) {
    const std::lock_guard<std::mutex> lock(mutex_);
    open_.erase(connection);
    emptied_.notify_all();
  }
  void StopAll();
  // Of a connection; its first member, so that it is counted until all others are gone.
  struct Membership {
    Registry* registry;
    Connection* connection;
    ~Membership() { registry->Remove(connection); }
  };
  bool stopping() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return stopping_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable emptied_;
  std::map<Connection*, std::weak_ptr<Connection>> open_;  // guarded by mutex_
  bool stopping_ = false;                                  // guarded by mutex_
};

// All callbacks run on the stream's strand, one after the other.
class Connection : public Exchange, public std::enable_shared_from_this<Connection> {
 public:
  Connection(tcp::socket socket, const HttpOptions* options, const Handler* handler, Registry* registry)
      : membership_{registry, this},
        stream_(std::move(socket)),
        options_(options),
        handler_(handler),
        ending_(stream_.get_executor()) {
    parser_.header_limit(options->limits.head_bytes);
    parser_.body_limit(options->limits.body_bytes);
  }

  void Run() {
    if (!membership_.registry->Add(this, weak_from_this(), options_->limits.connections)) {
      Refuse(absl::UnavailableError(
          absl::StrCat("too many connections at once; at most ", options_->limits.connections)));
      return;
    }
    stream_.expires_after(Milliseconds(options_->limits.head_s));
    http::async_read_header(
        stream_, buffer_, parser_, [self = shared_from_this()](beast::error_code error, size_t) {
          if (error == http::error::header_limit)
            return self->Refuse(absl::ResourceExhaustedError(absl::StrCat(
                "the head of the request is larger than ", self->options_->limits.head_bytes, " bytes")));
          if (error == http::error::body_limit) return self->RefuseBody();
          if (!error) self->CheckHead();
        });
  }
  void Stop() {
    asio::post(stream_.get_executor(), [self = shared_from_this()] { self->Leave(); });
  }

  const HttpRequest& request() const override { return request_; }

  void Reply(unsigned status, HttpFields fields, std::string body) override {
    auto response =
        std::make_shared<http::response<http::string_body>>(http::response_header<>(std::move(fields)));
    response->result(status);
    SetCommon(&response->base());
    if (!asked_by_.empty()) response->set(http::field::access_control_allow_origin, asked_by_);
    response->keep_alive(false);
    response->body() = std::move(body);
    response->prepare_payload();
    asio::post(stream_.get_executor(), [self = shared_from_this(), response] {
      self->stream_.expires_after(Milliseconds(self->options_->limits.stall_s));
      http::async_write(self->stream_, *response,
                        [self, response](beast::error_code, size_t) { self->Finish(); });
    });
  }

  void Begin(HttpFields fields) override {
    asio::post(stream_.get_executor(), [self = shared_from_this(), fields = std::move(fields)]() mutable {
      self->head_.emplace(http::response_header<>(std::move(fields)));
      SetCommon(&self->head_->base());
      self->head_->result(200);
      self->head_->keep_alive(false);
      self->head_->chunked(true);
    });
  }

  void Write(std::string piece, std::function<void(bool)> taken) override {
    auto kept = std::make_shared<std::string>(std::move(piece));
    asio::post(stream_.get_executor(), [self = shared_from_this(), kept, taken = std::move(taken)] {
      if (self->left_) return taken(false);
      self->WithHead([self, kept, taken](beast::error_code failed) {
        if (failed) return self->Leave(), taken(false);
        self->stream_.expires_after(Milliseconds(self->options_->limits.stall_s));
        asio::async_write(self->stream_, http::make_chunk(asio::buffer(*kept)),
                          [self, kept, taken](beast::error_code error, size_t) {
                            self->stream_.expires_never();
                            if (error) self->Leave();
                            taken(!error);
                          });
      });
    });
  }

  void End() override {
    asio::post(stream_.get_executor(), [self = shared_from_this()] {
      if (self->left_) return;
      self->WithHead([self](beast::error_code failed) {
        if (failed) return self->Finish();
        self->stream_.expires_after(Milliseconds(self->options_->limits.stall_s));
        asio::async_write(self->stream_, http::make_chunk_last(),
                          [self](beast::error_code, size_t) { self->Finish(); });
      });
    });
  }

  void OnGone(std::function<void()> gone) override {
    asio::post(stream_.get_executor(), [self = shared_from_this(), gone = std::move(gone)]() mutable {
      if (self->left_) return gone();
      self->gone_ = std::move(gone);
    });
  }

 private:
  // Before the body is read: who asks, and for how much.
  void CheckHead() {
    const auto& head = parser_.get();
    const bool page = head.target() == options_->open_path;
    absl::Status allowed = options_->beside_page ? CheckOriginBesidePage(head) : CheckOrigin(head, page);
    if (allowed.ok() && !page && !options_->beside_page) allowed = CheckToken(head, options_->token);
    if (options_->beside_page) asked_by_ = std::string(head[http::field::origin]);
    if (!allowed.ok()) return Refuse(allowed);
    stream_.expires_after(Milliseconds(options_->limits.stall_s));
    http::async_read(stream_, buffer_, parser_, [self = shared_from_this()](beast::error_code error, size_t) {
      if (error == http::error::body_limit) return self->RefuseBody();
      if (error) return;
      self->request_ = self->parser_.release();
      self->stream_.expires_never();
      self->Watch();
      (*self->handler_)(self);
    });
  }

  // A request that is not answered further: what it still sends is not read.
  void Refuse(const absl::Status& why) { ReplyStatus(this, why); }

  void RefuseBody() {
    Refuse(absl::ResourceExhaustedError(
        absl::StrCat("the body of the request is larger than ", options_->limits.body_bytes, " bytes")));
  }

  // A client says nothing more, so that whatever arrives is its end.
  void Watch() {
    watched_.resize(1);
    stream_.socket().async_read_some(
        asio::buffer(watched_),
        asio::bind_executor(stream_.get_executor(),
                            [self = shared_from_this()](beast::error_code, size_t) { self->Leave(); }));
  }

  void Leave() {
    if (std::exchange(left_, true)) return;
    if (gone_) std::exchange(gone_, nullptr)();
    ending_.cancel();
    beast::error_code ignored;
    stream_.socket().close(ignored);
    stream_.cancel();
  }

  // The answer is out. Closing at once could throw away what the other side has not read yet.
  void Finish() {
    gone_ = nullptr;
    beast::error_code ignored;
    stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    ending_.expires_after(Milliseconds(kDrainS));
    ending_.async_wait([self = shared_from_this()](beast::error_code) { self->Leave(); });
    if (!request_.target().empty()) return;  // Watch sees the other side close
    stream_.expires_never();
    Drain();
  }

  // What a refused client still sends is read and dropped for a moment, so that it reads the refusal.
  void Drain() {
    drained_.resize(1 << 16);
    stream_.async_read_some(asio::buffer(drained_),
                            [self = shared_from_this()](beast::error_code error, size_t) {
                              error ? self->Leave() : self->Drain();
                            });
  }

  template <typename Then>
  void WithHead(Then then) {
    if (!head_) return then(beast::error_code());
    auto serializer = std::make_shared<http::response_serializer<http::empty_body>>(*head_);
    stream_.expires_after(Milliseconds(options_->limits.stall_s));
    http::async_write_header(stream_, *serializer,
                             [self = shared_from_this(), serializer, then](beast::error_code error, size_t) {
                               self->head_.reset();
                               then(error);
                             });
  }

  const Registry::Membership membership_;
  beast::tcp_stream stream_;
  const HttpOptions* const options_;
  const Handler* const handler_;
  asio::steady_timer ending_;
  beast::flat_buffer buffer_;
  http::request_parser<http::string_body> parser_;
  HttpRequest request_;
  std::optional<http::response<http::empty_body>> head_;  // not sent yet
  std::function<void()> gone_;
  bool left_ = false;
  std::string watched_, drained_;
  std::string asked_by_;  // the origin of a page of another port, which reads the answer
};

void Registry::StopAll() {
  std::vector<std::shared_ptr<Connection>> open;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
    for (const auto& [connection, weak] : open_)
      if (std::shared_ptr<Connection> kept = weak.lock()) open.push_back(std::move(kept));
  }
  for (const std::shared_ptr<Connection>& connection : open) connection->Stop();
  open.clear();  // one of them may have had its last owner here
  std::unique_lock<std::mutex> lock(mutex_);
  emptied_.wait(lock, [&] { return open_.empty(); });
}

class LoopbackServer : public HttpServer {
 public:
  LoopbackServer(HttpOptions options, Handler handler)
      : options_(std::move(options)), handler_(std::move(handler)) {}
  ~LoopbackServer() override {
    asio::post(io_, [this] {
      beast::error_code ignored;
      acceptor_.close(ignored);
      pause_.cancel();
    });
    registry_.StopAll();
    io_.stop();
    for (std::thread& thread : threads_) thread.join();
  }

  beast::error_code Listen() {
    const tcp::endpoint at(asio::ip::address_v4::loopback(), static_cast<uint16_t>(options_.port));
    const beast::error_code error = ListenAt(at, &acceptor_, &port_);
    if (error) return error;
    Accept();
    for (int k = 0; k < kThreads; ++k) threads_.emplace_back([this] { io_.run(); });
    return error;
  }
  int port() const override { return port_; }

 private:
  void Accept() {
    acceptor_.async_accept(asio::make_strand(io_), [this](beast::error_code error, tcp::socket socket) {
      if (error == asio::error::operation_aborted || registry_.stopping()) return;
      if (!error) {
        std::make_shared<Connection>(std::move(socket), &options_, &handler_, &registry_)->Run();
        return Accept();
      }
      pause_.expires_after(kPause);  // out of descriptors: not in a busy loop
      pause_.async_wait([this](beast::error_code cancelled) {
        if (!cancelled) Accept();
      });
    });
  }

  const HttpOptions options_;
  const Handler handler_;
  Registry registry_;
  asio::io_context io_;
  // Calls answer from threads of gRPC: what they post is run even where no socket is open any more.
  const asio::executor_work_guard<asio::io_context::executor_type> work_{io_.get_executor()};
  tcp::acceptor acceptor_{io_};
  asio::steady_timer pause_{io_};
  int port_ = 0;
  std::vector<std::thread> threads_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<HttpServer>> HttpServer::Start(HttpOptions options, Handler handler) {
  const int port = options.port;
  auto server = std::make_unique<LoopbackServer>(std::move(options), std::move(handler));
  if (const beast::error_code error = server->Listen())
    return absl::UnavailableError(absl::StrCat("--port ", port, ": cannot listen at 127.0.0.1:", port, ": ",
                                               error.message(),
                                               "; another one, or 0 for any that is free, would do"));
  return server;
}

void ReplyStatus(Exchange* exchange, const absl::Status& status) {
  HttpFields fields;
  fields.set(http::field::content_type, "text/plain; charset=utf-8");
  exchange->Reply(HttpStatus(status), std::move(fields), absl::StrCat(std::string(status.message()), "\n"));
}

}  // namespace touchstone::workbench
