#include "server/gateway/effector/serial_port.h"

#include <fcntl.h>
#include <linux/serial.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <cstdlib>
#include <cstring>
#include <utility>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

namespace touchstone::gateway::effector {
namespace {

struct Rate {
  int baud;
  speed_t speed;
};
constexpr Rate kRates[] = {{9600, B9600},      {19200, B19200},     {38400, B38400},     {57600, B57600},
                           {115200, B115200},  {230400, B230400},   {460800, B460800},   {500000, B500000},
                           {921600, B921600},  {1000000, B1000000}, {2000000, B2000000}, {3000000, B3000000},
                           {4000000, B4000000}};

// Whether bytes go over a wire at the port's rate.
bool IsUart(const std::string& path) {
  char resolved[PATH_MAX];
  const std::string device = realpath(path.c_str(), resolved) != nullptr ? resolved : path;
  for (const char* prefix : {"/dev/ttyUSB", "/dev/ttyS", "/dev/ttyAMA", "/dev/ttyTHS", "/dev/ttymxc"})
    if (absl::StartsWith(device, prefix)) return true;
  return false;
}

absl::Status Problem(const std::string& path, const char* what) {
  return absl::UnavailableError(absl::StrCat("serial port ", path, ": ", what, ": ", std::strerror(errno)));
}

}  // namespace

SerialPort::SerialPort(SerialPort&& other) noexcept {
  *this = std::move(other);
}

SerialPort& SerialPort::operator=(SerialPort&& other) noexcept {
  std::swap(fd_, other.fd_);
  std::swap(path_, other.path_);
  std::swap(seconds_per_byte_, other.seconds_per_byte_);
  return *this;
}

absl::StatusOr<SerialPort> SerialPort::Open(const std::string& path, int baud) {
  const Rate* rate = nullptr;
  for (const Rate& each : kRates)
    if (each.baud == baud) rate = &each;
  if (rate == nullptr)
    return absl::InvalidArgumentError(
        absl::StrCat("serial port ", path, ": no rate of ", baud, " baud; usual is 115200"));

  SerialPort port;
  port.path_ = path;
  port.fd_ = open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (port.fd_ < 0) return Problem(path, "cannot be opened");
  if (flock(port.fd_, LOCK_EX | LOCK_NB) != 0)
    return absl::UnavailableError(
        absl::StrCat("serial port ", path, " is used by another process; stop it first"));

  termios settings;
  if (tcgetattr(port.fd_, &settings) != 0) return Problem(path, "is no serial port");
  cfmakeraw(&settings);
  settings.c_cflag |= CLOCAL | CREAD;
  settings.c_cflag &= ~static_cast<tcflag_t>(CSTOPB | CRTSCTS | HUPCL);  // closing must not reset the device
  settings.c_cc[VMIN] = 0;
  settings.c_cc[VTIME] = 0;
  cfsetispeed(&settings, rate->speed);
  cfsetospeed(&settings, rate->speed);
  if (tcsetattr(port.fd_, TCSANOW, &settings) != 0) return Problem(path, "cannot be set to raw");
  tcflush(port.fd_, TCIOFLUSH);

  if (IsUart(path)) {
    port.seconds_per_byte_ = 10.0 / baud;
    // An adapter otherwise collects bytes for up to 16 ms. Not every driver knows this; then it stays slow.
    serial_struct serial;
    if (ioctl(port.fd_, TIOCGSERIAL, &serial) == 0) {
      serial.flags |= ASYNC_LOW_LATENCY;
      (void)ioctl(port.fd_, TIOCSSERIAL, &serial);
    }
  }
  return port;
}

void SerialPort::Close() {
  if (fd_ >= 0) close(fd_);
  fd_ = -1;
}

absl::StatusOr<size_t> SerialPort::Read(uint8_t* data, size_t room) {
  const ssize_t size = read(fd_, data, room);
  if (size >= 0) return static_cast<size_t>(size);
  if (errno == EAGAIN || errno == EINTR) return size_t{0};
  return Problem(path_, "the other end is gone");
}

absl::StatusOr<size_t> SerialPort::Write(const uint8_t* data, size_t size) {
  const ssize_t written = write(fd_, data, size);
  if (written >= 0) return static_cast<size_t>(written);
  if (errno == EAGAIN || errno == EINTR) return size_t{0};
  return Problem(path_, "the other end is gone");
}

}  // namespace touchstone::gateway::effector
