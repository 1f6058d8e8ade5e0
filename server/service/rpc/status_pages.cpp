#include "server/service/rpc/status_pages.h"

#include <absl/strings/str_cat.h>
#include <grpcpp/client_context.h>
#include <spdlog/spdlog.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>

#include <chrono>
#include <optional>
#include <thread>
#include <vector>

#include "grpc/health/v1/health.grpc.pb.h"
#include "server/base/process/tcp_listen.h"
#include "server/service/channel/host_port.h"
#include "server/service/core/metrics.h"
#include "server/service/core/resources.h"
#include "server/service/options/access_options.h"

namespace touchstone::service {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using tcp = boost::asio::ip::tcp;

constexpr std::chrono::seconds kPatience{2};  // with a slow client
constexpr std::chrono::milliseconds kPause{200};
constexpr uint32_t kMaxHeadBytes = 8192;
// So that the counters are there while both probes wait for a server that does not answer.
constexpr int kThreads = 3;
constexpr char kPages[] = "GET /metrics, /livez or /readyz\n";

// Whether the server answers, and what.
grpc::Status Check(const std::shared_ptr<grpc::Channel>& channel, bool* serving) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(5));
  grpc::health::v1::HealthCheckResponse response;
  const grpc::Status status = grpc::health::v1::Health::NewStub(channel)->Check(&context, {}, &response);
  *serving = status.ok() && response.status() == grpc::health::v1::HealthCheckResponse::SERVING;
  return status;
}

}  // namespace

// One request and its answer; it lives as long as something is under way.
class StatusPages::Connection : public std::enable_shared_from_this<StatusPages::Connection> {
 public:
  Connection(tcp::socket socket, const StatusPages* pages) : stream_(std::move(socket)), pages_(pages) {
    parser_.header_limit(kMaxHeadBytes);
  }

  void Run() {
    stream_.expires_after(kPatience);
    http::async_read_header(stream_, buffer_, parser_,
                            [self = shared_from_this()](beast::error_code error, size_t) {
                              if (!error) self->Answer();
                            });
  }

 private:
  void Answer() {
    const auto& request = parser_.get();
    const std::string target(request.target());
    const Page page = request.method() == http::verb::get ? pages_->PageAt(target.substr(0, target.find('?')))
                                                          : Page{405, kPages};
    response_.result(page.status);
    response_.set(http::field::content_type, "text/plain; version=0.0.4; charset=utf-8");
    response_.keep_alive(false);
    response_.body() = page.text;
    response_.prepare_payload();
    stream_.expires_after(kPatience);
    http::async_write(stream_, response_, [self = shared_from_this()](beast::error_code, size_t) {
      beast::error_code ignored;
      self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    });
  }

  beast::tcp_stream stream_;
  const StatusPages* const pages_;
  beast::flat_buffer buffer_;
  http::request_parser<http::empty_body> parser_;
  http::response<http::string_body> response_;
};

class StatusPages::Http {
 public:
  explicit Http(const StatusPages* pages) : pages_(pages) {}
  ~Http() {
    io_.stop();
    for (std::thread& thread : threads_) thread.join();
  }

  // Returns what went wrong, and serves from then on if nothing did.
  beast::error_code Listen(const std::string& host, const std::string& port) {
    beast::error_code error;
    const auto found = tcp::resolver(io_).resolve(host, port, tcp::resolver::passive, error);
    if (error) return error;
    error = ListenAt(found.begin()->endpoint(), &acceptor_, &port_);
    if (error) return error;
    Accept();
    // A connection is one chain of callbacks, and so is accepting.
    for (int k = 0; k < kThreads; ++k) threads_.emplace_back([this] { io_.run(); });
    return error;
  }
  int port() const { return port_; }

 private:
  void Accept() {
    acceptor_.async_accept([this](beast::error_code error, tcp::socket socket) {
      if (!error) {
        std::make_shared<Connection>(std::move(socket), pages_)->Run();
        Accept();
        return;
      }
      pause_.expires_after(kPause);  // out of descriptors: not in a busy loop
      pause_.async_wait([this](beast::error_code) { Accept(); });
    });
  }

  const StatusPages* const pages_;
  asio::io_context io_;
  tcp::acceptor acceptor_{io_};
  asio::steady_timer pause_{io_};
  int port_ = 0;
  std::vector<std::thread> threads_;
};

absl::StatusOr<std::unique_ptr<StatusPages>> StatusPages::Start(const std::string& address,
                                                                const Resources* resources,
                                                                std::shared_ptr<grpc::Channel> channel) {
  const std::optional<HostPort> parsed = ParseHostPort(address);
  if (!parsed)
    return absl::InvalidArgumentError(absl::StrCat(
        "metrics = '", address, "': write HOST:PORT with a port up to 65535, for instance 127.0.0.1:9464"));
  const std::string host = parsed->host.empty() ? "127.0.0.1" : parsed->host;
  if (!parsed->host.empty() && !IsLocalAddress(address))
    spdlog::warn("metrics: other machines can read the counters at {} in plain text; they change nothing",
                 address);
  std::unique_ptr<StatusPages> pages(new StatusPages(resources, std::move(channel)));
  const beast::error_code error = pages->http_->Listen(host, absl::StrCat(parsed->port));
  if (error)
    return absl::UnavailableError(absl::StrCat("metrics = '", address,
                                               "': cannot listen there: ", error.message(),
                                               "; is the address right, and the port free?"));
  spdlog::info("metrics at http://{}:{}/metrics, probes at /livez and /readyz", host, pages->port());
  return pages;
}

StatusPages::StatusPages(const Resources* resources, std::shared_ptr<grpc::Channel> channel)
    : resources_(resources), channel_(std::move(channel)), http_(std::make_unique<Http>(this)) {}

StatusPages::~StatusPages() = default;

int StatusPages::port() const {
  return http_->port();
}

void StatusPages::StopAsking() {
  const std::lock_guard<std::mutex> lock(asking_mutex_);
  asking_ = false;
}

StatusPages::Page StatusPages::Liveness() const {
  const std::lock_guard<std::mutex> lock(asking_mutex_);
  if (!asking_) return {200, "alive, draining\n"};
  bool serving = false;
  // Whatever it answers: it is alive.
  if (Check(channel_, &serving).error_code() != grpc::StatusCode::DEADLINE_EXCEEDED) return {200, "alive\n"};
  return {503, "no answer from gRPC within 5 s\n"};
}

StatusPages::Page StatusPages::Readiness() const {
  const std::lock_guard<std::mutex> lock(asking_mutex_);
  if (!asking_) return {503, "draining\n"};
  bool serving = false;
  Check(channel_, &serving);
  return serving ? Page{200, "ready\n"} : Page{503, "not serving\n"};
}

StatusPages::Page StatusPages::PageAt(const std::string& path) const {
  if (path == "/metrics") return {200, MetricsText(*resources_)};
  if (path == "/livez") return Liveness();
  if (path == "/readyz") return Readiness();
  return {404, kPages};
}

}  // namespace touchstone::service
