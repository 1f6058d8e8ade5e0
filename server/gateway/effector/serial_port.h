// A serial port as a raw stream of bytes: termios, 8N1, no flow control, no waiting.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

namespace touchstone::gateway::effector {

class SerialPort {
 public:
  SerialPort() = default;
  ~SerialPort() { Close(); }
  SerialPort(SerialPort&& other) noexcept;
  SerialPort& operator=(SerialPort&& other) noexcept;

  // UNAVAILABLE: it is missing, may not be opened, or another process has it; the text says which.
  // INVALID_ARGUMENT: no such rate. What had been received before is thrown away.
  static absl::StatusOr<SerialPort> Open(const std::string& path, int baud);
  void Close();

  int fd() const { return fd_; }
  // Bytes read, 0 if there are none now; UNAVAILABLE once the other end is gone.
  absl::StatusOr<size_t> Read(uint8_t* data, size_t room);
  // Bytes taken, perhaps none.
  absl::StatusOr<size_t> Write(const uint8_t* data, size_t size);
  // How long a byte takes on the wire: known for a UART; 0 for USB and pseudo-terminals, whose rate is
  // only a name.
  double seconds_per_byte() const { return seconds_per_byte_; }

 private:
  int fd_ = -1;
  std::string path_;
  double seconds_per_byte_ = 0;
};

}  // namespace touchstone::gateway::effector
