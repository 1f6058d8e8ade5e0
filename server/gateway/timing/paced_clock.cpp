#include "server/gateway/timing/paced_clock.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <new>
#include <stdexcept>

#include <absl/strings/str_cat.h>

namespace touchstone::gateway::timing {
namespace {

static_assert(std::atomic<double>::is_always_lock_free && std::atomic<uint64_t>::is_always_lock_free);

std::string Complaint(const std::string& what, const std::string& file) {
  return absl::StrCat("the clock of the emulated rig: cannot ", what, " ", file, ": ", std::strerror(errno));
}

std::shared_ptr<PacedClock> Map(int fd, int protection) {
  void* const memory = mmap(nullptr, sizeof(PacedClock), protection, MAP_SHARED, fd, 0);
  if (memory == MAP_FAILED) return nullptr;
  return {static_cast<PacedClock*>(memory), [](PacedClock* clock) { munmap(clock, sizeof(PacedClock)); }};
}

}  // namespace

double PacedClock::Course::SinceS(double now_steady_s) const {
  return std::min(until_s, since_s + std::max(0.0, now_steady_s - steady_s));
}

void PacedClock::Set(const Course& course) {
  const uint64_t next = version_.load() + 1;
  Slot& slot = slots_[next % 2];
  slot.steady_s = course.steady_s;
  slot.since_s = course.since_s;
  slot.until_s = course.until_s;
  slot.began_s = course.began_s;
  version_ = next;
}

PacedClock::Course PacedClock::Get() const {
  for (;;) {
    const uint64_t version = version_.load();
    const Slot& slot = slots_[version % 2];
    const Course course{slot.steady_s, slot.since_s, slot.until_s, slot.began_s};
    if (version_.load() == version) return course;
  }
}

std::shared_ptr<PacedClock> MakePacedClock(const std::string& file) {
  unlink(file.c_str());
  const int fd = open(file.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (fd < 0) throw std::runtime_error(Complaint("make", file));
  const auto clock = ftruncate(fd, sizeof(PacedClock)) == 0 ? Map(fd, PROT_READ | PROT_WRITE) : nullptr;
  const std::string complaint = Complaint("map", file);
  close(fd);
  if (clock == nullptr) throw std::runtime_error(complaint);
  new (clock.get()) PacedClock;
  return clock;
}

absl::StatusOr<std::shared_ptr<const PacedClock>> OpenPacedClock(const std::string& file) {
  const int fd = open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return absl::NotFoundError(Complaint("open", file));
  struct stat information {};
  const bool whole = fstat(fd, &information) == 0 && information.st_size == sizeof(PacedClock);
  const auto clock = whole ? Map(fd, PROT_READ) : nullptr;
  const std::string complaint = Complaint("map", file);
  close(fd);
  if (clock == nullptr)
    return absl::InvalidArgumentError(
        whole ? complaint : absl::StrCat(file, " is no clock of an emulated rig: it has another size"));
  return clock;
}

}  // namespace touchstone::gateway::timing
