#include "server/service/connections/wire.h"

#include <sys/socket.h>

#include <cerrno>

namespace touchstone::service {
namespace {

class Plain final : public Wire {
 public:
  explicit Plain(int file) : file_(file) {}
  Moved Read(char* to, size_t size) override { return MovedBy(::recv(file_, to, size, MSG_DONTWAIT)); }
  Moved Write(absl::string_view bytes) override {
    return MovedBy(::send(file_, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL));
  }

 private:
  static Moved MovedBy(ssize_t bytes) {
    if (bytes > 0) return {State::kMoved, static_cast<size_t>(bytes)};
    const bool later = bytes < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR);
    return {later ? State::kBlocked : State::kEnded, 0};
  }

  const int file_;
};

}  // namespace

std::unique_ptr<Wire> PlainWire(int file) {
  return std::make_unique<Plain>(file);
}

}  // namespace touchstone::service
