// The client's end of a connection: bytes of a socket, in plain text or TLS.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include <absl/strings/string_view.h>

namespace touchstone::service {

// Never blocks. Not for several threads.
class Wire {
 public:
  virtual ~Wire() = default;

  enum class State { kMoved, kBlocked, kEnded };
  struct Moved {
    State state;
    size_t bytes;  // 0 unless kMoved
  };
  virtual Moved Read(char* to, size_t size) = 0;
  virtual Moved Write(absl::string_view bytes) = 0;
  // Whether bytes can be read that no longer lie in the socket.
  virtual bool buffered() const { return false; }
  // Whether a read waits until the socket takes bytes.
  virtual bool reads_when_writable() const { return false; }
  // Names of the client's certificate, once something was read.
  virtual std::vector<std::string> CertificateNames() const { return {}; }
};

// `file` stays the caller's.
std::unique_ptr<Wire> PlainWire(int file);

}  // namespace touchstone::service
