// HTTP/1.1 at 127.0.0.1: one request a connection, whose answer may come in pieces. Only what request_guard.h lets through
// gets to a handler.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include <absl/status/statusor.h>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>

namespace touchstone::workbench {

// What one request, or all together, may use; a row each in server/LIMITS.md.
struct HttpLimits {
  int connections = 64;
  uint32_t head_bytes = 16 << 10;
  uint64_t body_bytes = 256 << 20;  // client::kMaxMessageBytes
  double head_s = 10;               // for the head of a request
  double stall_s = 60;              // for a body, or for a piece of an answer to be taken
};

using HttpRequest = boost::beast::http::request<boost::beast::http::string_body>;
using HttpFields = boost::beast::http::fields;

// One request and its answer. Everything may be called from any thread.
class Exchange {
 public:
  virtual ~Exchange() = default;
  virtual const HttpRequest& request() const = 0;
  // A whole answer.
  virtual void Reply(unsigned status, HttpFields fields, std::string body) = 0;
  // An answer in pieces: Begin, then Write, each after the one before was taken, then End. `taken`: false where nobody listens.
  virtual void Begin(HttpFields fields) = 0;
  virtual void Write(std::string piece, std::function<void(bool)> taken) = 0;
  virtual void End() = 0;
  // Called once if the other side goes before the answer has ended, or the server stops.
  virtual void OnGone(std::function<void()> gone) = 0;
};

using Handler = std::function<void(std::shared_ptr<Exchange>)>;

struct HttpOptions {
  int port = 0;  // 0: any free one
  HttpLimits limits;
  std::string token;  // that everything but `open_path` asks for
  std::string open_path = "/";
  // For a port beside the page's own, so that nothing that the page waits for stands in its way: pages of any port of this machine
  // may ask, without the head's token; the handler asks for it in the body.
  bool beside_page = false;
};

class HttpServer {
 public:
  static absl::StatusOr<std::unique_ptr<HttpServer>> Start(HttpOptions options, Handler handler);
  virtual ~HttpServer() = default;  // ends what is under way, and waits for it
  virtual int port() const = 0;
};

// Texts of refusals and local errors: plain, one line.
void ReplyStatus(Exchange* exchange, const absl::Status& status);

}  // namespace touchstone::workbench
