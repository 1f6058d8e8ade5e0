// arc4random_buf of glibc 2.36, which a static libarchive of Debian 12 calls: of the program itself, so that it runs with the
// glibc 2.35 of Ubuntu 22.04 too (deploy/package).
#include <sys/random.h>

#include <cerrno>
#include <cstddef>
#include <cstdlib>

extern "C" void arc4random_buf(void* buffer, size_t size) noexcept {
  char* at = static_cast<char*>(buffer);
  while (size > 0) {
    const ssize_t written = ::getrandom(at, size, 0);
    if (written < 0 && errno != EINTR) std::abort();  // it promises random bytes and has no way to fail
    if (written > 0) at += written, size -= static_cast<size_t>(written);
  }
}
