#include "tests/rig/world/serial_line.h"

#include <fcntl.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <limits>

#include "tests/rig/world/system_error.h"

namespace touchstone::rig {
namespace {

// A driver keeps so much for a program that does not read; older bytes go then.
constexpr size_t kMaxUnreadBytes = 3000;

}  // namespace

SerialLine::SerialLine(std::string link, double byte_s, uint64_t seed, const Faults* faults)
    : link_(std::move(link)), byte_s_(byte_s), random_(seed), faults_(faults) {
  Plug();
}

SerialLine::~SerialLine() {
  Unplug();
}

void SerialLine::Plug() {
  if (plugged()) return;
  master_ = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  char name[128];
  if (master_ < 0 || grantpt(master_) != 0 || unlockpt(master_) != 0 ||
      ptsname_r(master_, name, sizeof name) != 0)
    FailWithErrno("cannot make a pseudo-terminal");
  // Our own end of the other side keeps it raw while nobody has it open.
  slave_ = open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
  termios raw{};
  if (slave_ < 0 || tcgetattr(slave_, &raw) != 0) FailWithErrno(std::string("cannot open ") + name);
  cfmakeraw(&raw);
  tcsetattr(slave_, TCSANOW, &raw);

  // The link is there as a whole or not at all.
  const std::string part = link_ + ".part";
  unlink(part.c_str());
  if (symlink(name, part.c_str()) != 0 || rename(part.c_str(), link_.c_str()) != 0)
    FailWithErrno("cannot link " + link_);
}

void SerialLine::Unplug() {
  if (!plugged()) return;
  unlink(link_.c_str());
  close(master_);
  if (slave_ >= 0) close(slave_);
  master_ = slave_ = -1;
  to_device_ = from_device_ = Way();
}

void SerialLine::Send(Way* way, const uint8_t* bytes, size_t size, double now_s) {
  const double drop = faults_->Get("drop_bytes"), corrupt = faults_->Get("corrupt_bytes"),
               duplicate = faults_->Get("duplicate_bytes"), delay_s = 1e-3 * faults_->Get("line_delay_ms");
  std::uniform_real_distribution<double> part(0, 1);
  Chunk chunk;
  for (size_t k = 0; k < size; ++k) {
    if (drop > 0 && part(random_) < drop) continue;
    uint8_t byte = bytes[k];
    if (corrupt > 0 && part(random_) < corrupt) byte ^= static_cast<uint8_t>(1 + random_() % 255);
    chunk.bytes.push_back(byte);
    if (duplicate > 0 && part(random_) < duplicate) chunk.bytes.push_back(byte);
  }
  way->free_s = std::max(now_s, way->free_s) + byte_s_ * size;
  chunk.due_s = way->free_s + (delay_s > 0 ? delay_s * part(random_) : 0);
  if (!way->chunks.empty()) chunk.due_s = std::max(chunk.due_s, way->chunks.back().due_s);
  if (!chunk.bytes.empty()) way->chunks.push_back(std::move(chunk));
}

void SerialLine::Write(const uint8_t* bytes, size_t size, double now_s) {
  if (plugged()) Send(&from_device_, bytes, size, now_s);
}

std::vector<uint8_t> SerialLine::Exchange(double now_s) {
  std::vector<uint8_t> arrived;
  if (!plugged()) return arrived;
  uint8_t buffer[512];
  for (;;) {
    const ssize_t got = read(master_, buffer, sizeof buffer);
    if (got <= 0) break;
    Send(&to_device_, buffer, static_cast<size_t>(got), now_s);
  }
  while (!to_device_.chunks.empty() && to_device_.chunks.front().due_s <= now_s) {
    const auto& bytes = to_device_.chunks.front().bytes;
    arrived.insert(arrived.end(), bytes.begin(), bytes.end());
    to_device_.chunks.pop_front();
  }
  while (!from_device_.chunks.empty() && from_device_.chunks.front().due_s <= now_s) {
    const auto& bytes = from_device_.chunks.front().bytes;
    if (const size_t unread = Waiting(); unread > kMaxUnreadBytes) {
      tcflush(slave_, TCIFLUSH);
      lost_bytes_ += unread;
    }
    if (write(master_, bytes.data(), bytes.size()) < 0 && errno != EAGAIN && errno != EIO)
      FailWithErrno("cannot write to " + link_);
    from_device_.chunks.pop_front();
  }
  return arrived;
}

size_t SerialLine::Waiting() const {
  int unread = 0;
  return plugged() && ioctl(slave_, FIONREAD, &unread) == 0 ? static_cast<size_t>(unread) : 0;
}

size_t SerialLine::Unread() {
  const size_t waiting = Waiting();
  if (waiting == 0) lost_bytes_ = 0;
  return waiting + lost_bytes_;
}

double SerialLine::NextDueS() const {
  double due_s = std::numeric_limits<double>::infinity();
  for (const Way* way : {&to_device_, &from_device_})
    if (!way->chunks.empty()) due_s = std::min(due_s, way->chunks.front().due_s);
  return due_s;
}

}  // namespace touchstone::rig
