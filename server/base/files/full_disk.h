// For tests: while it lives, no file of this process can grow or be written, as on a disk that is full.
#pragma once

#include <signal.h>
#include <sys/resource.h>

namespace touchstone {

class FullDisk {
 public:
  FullDisk() {
    signal(SIGXFSZ, SIG_IGN);  // the write fails instead (EFBIG)
    getrlimit(RLIMIT_FSIZE, &before_);
    rlimit none = before_;
    none.rlim_cur = 1;
    setrlimit(RLIMIT_FSIZE, &none);
  }
  ~FullDisk() { setrlimit(RLIMIT_FSIZE, &before_); }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  rlimit before_{};
};

}  // namespace touchstone
