#include "server/service/connections/sparse_warning.h"

#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include <utility>

namespace touchstone::service {

void SparseWarning::Say(const std::string& words) {
  const auto now = clock_.Now();
  uint64_t unsaid = 0;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (now - said_ < std::chrono::seconds(1)) {
      ++unsaid_;
      return;
    }
    said_ = now;
    std::swap(unsaid, unsaid_);
  }
  spdlog::warn("{}{}", words, unsaid == 0 ? "" : absl::StrCat("; ", unsaid, " more before"));
}

}  // namespace touchstone::service
