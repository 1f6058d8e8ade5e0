// A disk that fails, or a kill, at the n-th call of a program on the files below one folder: preloaded into it (LD_PRELOAD).
// Counted are the calls that open, make, write, cut, sync, close, link, rename and remove; those of libraries (HDF5, SQLite)
// too. TOUCHSTONE_FAILING_FILES names a file of a `FailurePlan`, which the test keeps mapped; a test may also be linked with it.
#include "tests/faults/preloaded/failing_files.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

using touchstone::faults::FailureMode;
using touchstone::faults::FailurePlan;

FailurePlan* plan = nullptr;

#ifdef TOUCHSTONE_PRELOADED
__attribute__((constructor)) void MapPlan() {
  const char* path = std::getenv("TOUCHSTONE_FAILING_FILES");
  const int file = path == nullptr ? -1 : open(path, O_RDWR | O_CLOEXEC);
  void* bytes =
      file < 0 ? MAP_FAILED : mmap(nullptr, sizeof(FailurePlan), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  if (bytes == MAP_FAILED) {
    std::fprintf(stderr, "TOUCHSTONE_FAILING_FILES = '%s': must name a file of %zu bytes\n",
                 path == nullptr ? "" : path, sizeof(FailurePlan));
    _exit(2);
  }
  close(file);
  plan = static_cast<FailurePlan*>(bytes);
}
#endif

bool Below(const char* path) {
  const size_t length = std::strlen(plan->folder);
  return length > 0 && std::strncmp(path, plan->folder, length) == 0 &&
         (path[length] == '/' || path[length] == '\0');
}

bool IsWatched(int descriptor) {
  if (plan == nullptr || descriptor <= STDERR_FILENO) return false;
  char name[64], path[PATH_MAX];
  std::snprintf(name, sizeof name, "/proc/self/fd/%d", descriptor);
  const ssize_t length = readlink(name, path, sizeof path - 1);
  if (length <= 0) return false;
  path[length] = '\0';
  return Below(path);
}

bool IsWatched(int folder, const char* path) {
  if (plan == nullptr || path == nullptr) return false;
  if (path[0] == '/') return Below(path);
  if (folder != AT_FDCWD) return IsWatched(folder);
  char here[PATH_MAX];
  return getcwd(here, sizeof here) != nullptr && Below(here);
}

// Whether this call, on something that is watched, fails; errno is set then.
bool Fails(const char* call, bool takes_room = true) {
  // A failed removal leaves what is whole: of the other modes only a kill may come before it.
  const bool removes = std::strcmp(call, "unlink") == 0;
  if (plan->mode == FailureMode::kRemoval ? !removes : removes && plan->mode != FailureMode::kKill)
    return false;
  const int32_t number = ++plan->calls, fails_at = plan->fails_at;
  const FailureMode mode = plan->mode;
  // A full disk is one to what takes room; what was made can still be looked at and removed.
  if (fails_at == 0 || number < fails_at ||
      (number != fails_at && (mode != FailureMode::kFromThenOn || !takes_room)))
    return false;
  if (number == fails_at) std::snprintf(plan->failed, sizeof plan->failed, "%s", call);
  if (mode == FailureMode::kKill) raise(SIGKILL);
  if (mode == FailureMode::kShort) return false;
  errno = plan->error;
  return true;
}

// Whether the call that was just counted writes less than it was asked to.
bool IsShort() {
  return plan->mode == FailureMode::kShort && plan->calls == plan->fails_at;
}

template <typename Function>
Function* Own(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

size_t Less(size_t bytes) {
  return IsShort() && bytes > 1 ? bytes / 2 : bytes;
}

}  // namespace

void touchstone::faults::SetFailurePlan(FailurePlan* of_this_process) {
  plan = of_this_process;
}

#define MODE_OF(flags)                                              \
  mode_t mode = 0;                                                  \
  if (((flags)&O_CREAT) != 0 || ((flags)&O_TMPFILE) == O_TMPFILE) { \
    va_list list;                                                   \
    va_start(list, flags);                                          \
    mode = va_arg(list, mode_t);                                    \
    va_end(list);                                                   \
  }

extern "C" {

int open(const char* path, int flags, ...) {
  MODE_OF(flags)
  if (IsWatched(AT_FDCWD, path) && Fails("open", (flags & O_CREAT) != 0)) return -1;
  return Own<int(const char*, int, ...)>("open")(path, flags, mode);
}
int open64(const char* path, int flags, ...) {
  MODE_OF(flags)
  if (IsWatched(AT_FDCWD, path) && Fails("open", (flags & O_CREAT) != 0)) return -1;
  return Own<int(const char*, int, ...)>("open64")(path, flags, mode);
}
int openat(int folder, const char* path, int flags, ...) {
  MODE_OF(flags)
  if (IsWatched(folder, path) && Fails("open", (flags & O_CREAT) != 0)) return -1;
  return Own<int(int, const char*, int, ...)>("openat")(folder, path, flags, mode);
}
int openat64(int folder, const char* path, int flags, ...) {
  MODE_OF(flags)
  if (IsWatched(folder, path) && Fails("open", (flags & O_CREAT) != 0)) return -1;
  return Own<int(int, const char*, int, ...)>("openat64")(folder, path, flags, mode);
}
FILE* fopen(const char* path, const char* how) {
  if (IsWatched(AT_FDCWD, path) && Fails("fopen")) return nullptr;
  return Own<FILE*(const char*, const char*)>("fopen")(path, how);
}
FILE* fopen64(const char* path, const char* how) {
  if (IsWatched(AT_FDCWD, path) && Fails("fopen")) return nullptr;
  return Own<FILE*(const char*, const char*)>("fopen64")(path, how);
}

ssize_t write(int file, const void* bytes, size_t size) {
  auto* const own = Own<ssize_t(int, const void*, size_t)>("write");
  if (!IsWatched(file)) return own(file, bytes, size);
  return Fails("write") ? -1 : own(file, bytes, Less(size));
}
ssize_t pwrite(int file, const void* bytes, size_t size, off_t at) {
  auto* const own = Own<ssize_t(int, const void*, size_t, off_t)>("pwrite");
  if (!IsWatched(file)) return own(file, bytes, size, at);
  return Fails("pwrite") ? -1 : own(file, bytes, Less(size), at);
}
ssize_t pwrite64(int file, const void* bytes, size_t size, off64_t at) {
  auto* const own = Own<ssize_t(int, const void*, size_t, off64_t)>("pwrite64");
  if (!IsWatched(file)) return own(file, bytes, size, at);
  return Fails("pwrite") ? -1 : own(file, bytes, Less(size), at);
}
ssize_t writev(int file, const iovec* pieces, int count) {
  auto* const own = Own<ssize_t(int, const iovec*, int)>("writev");
  if (!IsWatched(file)) return own(file, pieces, count);
  if (Fails("writev")) return -1;
  return own(file, pieces, IsShort() ? std::min(count, 1) : count);
}

#define ON_DESCRIPTOR(name, parameters, arguments)  \
  int name parameters {                             \
    if (IsWatched(file) && Fails(#name)) return -1; \
    return Own<int parameters>(#name) arguments;    \
  }
ON_DESCRIPTOR(fsync, (int file), (file))
ON_DESCRIPTOR(fdatasync, (int file), (file))
ON_DESCRIPTOR(ftruncate, (int file, off_t size), (file, size))
ON_DESCRIPTOR(ftruncate64, (int file, off64_t size), (file, size))
ON_DESCRIPTOR(fallocate, (int file, int mode, off_t at, off_t size), (file, mode, at, size))
int syncfs(int file) noexcept {
  if (IsWatched(file) && Fails("syncfs")) return -1;
  return Own<int(int)>("syncfs")(file);
}
int posix_fallocate(int file, off_t at, off_t size) {
  if (IsWatched(file) && Fails("posix_fallocate")) return errno;
  return Own<int(int, off_t, off_t)>("posix_fallocate")(file, at, size);
}

// As the kernel does it: whatever it says, the descriptor is gone. What was only read, as a folder that is removed, finds no
// disk full.
int close(int file) {
  const bool fails = IsWatched(file) && Fails("close", (fcntl(file, F_GETFL) & O_ACCMODE) != O_RDONLY);
  const int error = errno;
  const int closed = Own<int(int)>("close")(file);
  if (!fails) return closed;
  errno = error;
  return -1;
}

int rename(const char* from, const char* to) noexcept {
  if (IsWatched(AT_FDCWD, to) && Fails("rename")) return -1;
  return Own<int(const char*, const char*)>("rename")(from, to);
}
int renameat(int from_folder, const char* from, int folder, const char* to) noexcept {
  if (IsWatched(folder, to) && Fails("rename")) return -1;
  return Own<int(int, const char*, int, const char*)>("renameat")(from_folder, from, folder, to);
}
int renameat2(int from_folder, const char* from, int folder, const char* to, unsigned flags) noexcept {
  if (IsWatched(folder, to) && Fails("rename")) return -1;
  return Own<int(int, const char*, int, const char*, unsigned)>("renameat2")(from_folder, from, folder, to,
                                                                             flags);
}
int link(const char* from, const char* to) noexcept {
  if (IsWatched(AT_FDCWD, to) && Fails("link")) return -1;
  return Own<int(const char*, const char*)>("link")(from, to);
}
int mkdir(const char* path, mode_t mode) noexcept {
  if (IsWatched(AT_FDCWD, path) && Fails("mkdir")) return -1;
  return Own<int(const char*, mode_t)>("mkdir")(path, mode);
}
int unlink(const char* path) noexcept {
  if (IsWatched(AT_FDCWD, path) && Fails("unlink")) return -1;
  return Own<int(const char*)>("unlink")(path);
}

}  // extern "C"
