// Which pages there are: each says now and then that it is there, and goodbye when it is closed. One that was killed says
// nothing, and is taken for gone after a while.
#pragma once

#include <chrono>
#include <map>
#include <string>

#include <absl/status/status.h>
#include <nlohmann/json.hpp>

namespace touchstone::workbench {

// For one thread at a time.
class Pages {
 public:
  using Time = std::chrono::steady_clock::time_point;

  struct Said {
    bool hidden = false;  // its tab is not the one that is seen
    bool begins =
        true;  // false: what it says while it is there, which may arrive after its goodbye and then counts for nothing
  };
  // `page` says that it is there. True in `changed` where others should hear of it. RESOURCE_EXHAUSTED: there are 1000 already.
  absl::Status Hear(const std::string& page, const Said& said, Time now, bool* changed);
  // `page` is closed, or loaded again: then it begins within kReload.
  void SayGoodbye(const std::string& page, Time now);
  bool IsThere(const std::string& page, Time now) const;
  // True where one went since it was asked last. Forgets those that went long ago.
  bool Went(Time now);
  // "page 2", in the order in which they came.
  std::string Name(const std::string& page) const;
  // {ID: {"number", "hidden", "there"}} of those that are there, and of `also` (empty: nobody).
  nlohmann::json List(Time now, const std::string& also) const;

 private:
  struct Page {
    int number = 0;
    Time until;  // then it is gone, unless it is heard of before
    bool hidden = false, left = false, counted = true;
  };
  std::map<std::string, Page> pages_;
  int last_number_ = 0;
};

}  // namespace touchstone::workbench
