// When a file was last written, so that what is read from it can be read again once it changes.
#pragma once

#include <cstdint>
#include <string>

namespace touchstone::service {

// Equal stamps: the same bytes, unless somebody wrote the same number of them within the clock's resolution.
struct FileStamp {
  bool exists = false;
  int64_t modified_ns = 0;
  uint64_t inode = 0;  // of another file that was moved into its place
  int64_t bytes = 0;

  // Follows links, as Kubernetes changes a secret by turning one.
  static FileStamp Of(const std::string& path);

  bool operator==(const FileStamp& other) const {
    return exists == other.exists && modified_ns == other.modified_ns && inode == other.inode &&
           bytes == other.bytes;
  }
  bool operator!=(const FileStamp& other) const { return !(*this == other); }
};

}  // namespace touchstone::service
