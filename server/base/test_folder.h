// A folder for the files of one test: new, empty, and gone with all that is in it when the object goes.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <string>

#include "server/base/check.h"

namespace touchstone {

class TestFolder {
 public:
  TestFolder() : path_((std::filesystem::temp_directory_path() / "touchstone_test_XXXXXX").string()) {
    TOUCHSTONE_CHECK(::mkdtemp(path_.data()) != nullptr);
  }
  ~TestFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;

  const std::string& path() const { return path_; }
  // How many files and folders it has.
  size_t Entries() const {
    return static_cast<size_t>(
        std::distance(std::filesystem::directory_iterator(path_), std::filesystem::directory_iterator()));
  }
  // Of a file in it.
  std::string Path(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

}  // namespace touchstone
