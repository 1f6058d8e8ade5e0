#include "server/service/connections/file_stamp.h"

#include <sys/stat.h>

namespace touchstone::service {

FileStamp FileStamp::Of(const std::string& path) {
  struct stat status {};
  FileStamp stamp;
  if (::stat(path.c_str(), &status) != 0) return stamp;
  stamp.exists = true;
  stamp.modified_ns = int64_t{status.st_mtim.tv_sec} * 1'000'000'000 + status.st_mtim.tv_nsec;
  stamp.inode = status.st_ino;
  stamp.bytes = status.st_size;
  return stamp;
}

}  // namespace touchstone::service
