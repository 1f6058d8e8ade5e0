#include "firmware/host/pty_effector.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <random>

#include <fcntl.h>
#include <termios.h>
#include <unistd.h>

namespace touchstone::firmware {
namespace {

// What is not read for so long is lost, frame by frame, as on a real line; the core repeats what matters.
constexpr size_t kMaxUnsent = 4096;

Identity MakeIdentity() {
  Identity identity;
  identity.boot_id = std::random_device()();
  identity.tick_hz = 1000000;
  identity.firmware = "host 0.1.0";
  return identity;
}

}  // namespace

std::unique_ptr<PtyEffector> PtyEffector::Open(std::string* error) {
  const auto fail = [&](const char* what, int master, int slave) {
    *error = std::string(what) + ": " + std::strerror(errno);
    if (master >= 0) close(master);
    if (slave >= 0) close(slave);
    return nullptr;
  };
  const int master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
  if (master < 0) return fail("no pseudo-terminal", -1, -1);
  char path[128];
  if (grantpt(master) != 0 || unlockpt(master) != 0 || ptsname_r(master, path, sizeof(path)) != 0) {
    return fail("pseudo-terminal cannot be unlocked", master, -1);
  }
  const int slave = open(path, O_RDWR | O_NOCTTY | O_CLOEXEC);
  if (slave < 0) return fail(path, master, -1);

  // Bytes as they are: no echo, no lines, no signals.
  termios settings;
  if (tcgetattr(slave, &settings) != 0) return fail(path, master, slave);
  cfmakeraw(&settings);
  if (tcsetattr(slave, TCSANOW, &settings) != 0) return fail(path, master, slave);
  return std::unique_ptr<PtyEffector>(new PtyEffector(master, slave, path));
}

PtyEffector::PtyEffector(int master, int slave, std::string path)
    : master_(master), slave_(slave), path_(std::move(path)), effector_(MakeIdentity(), &Write, &Now, this) {
  for (int finger = 0; finger < kMaxFingers; ++finger) Press(finger, false);
}

PtyEffector::~PtyEffector() {
  close(slave_);
  close(master_);
}

void PtyEffector::Run() {
  uint8_t bytes[256];
  ssize_t size;
  while ((size = read(master_, bytes, sizeof(bytes))) > 0) {
    for (ssize_t i = 0; i < size; ++i) effector_.OnByte(bytes[i]);
  }
  effector_.OnTime();
  Flush();
}

void PtyEffector::Press(int finger, bool pressed) {
  effector_.OnEdge(finger, pressed, Now(nullptr));
}

void PtyEffector::Sample(int finger, uint16_t value) {
  effector_.OnAnalogue(finger, value, Now(nullptr));
}

void PtyEffector::Write(void* context, const uint8_t* frame, size_t size) {
  PtyEffector* self = static_cast<PtyEffector*>(context);
  if (self->unsent_.size() + size > kMaxUnsent) return;
  self->unsent_.insert(self->unsent_.end(), frame, frame + size);
  self->Flush();
}

void PtyEffector::Flush() {
  uint8_t bytes[256];
  while (!unsent_.empty()) {
    const size_t size = std::min(unsent_.size(), sizeof(bytes));
    std::copy(unsent_.begin(), unsent_.begin() + static_cast<long>(size), bytes);
    const ssize_t written = write(master_, bytes, size);
    if (written <= 0) return;
    unsent_.erase(unsent_.begin(), unsent_.begin() + written);
  }
}

uint32_t PtyEffector::Now(void*) {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return static_cast<uint32_t>(std::chrono::duration_cast<std::chrono::microseconds>(now).count());
}

}  // namespace touchstone::firmware
