// Pages that follow one state: a stream of lines of JSON to each, in which a newer state replaces one that was not sent yet.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "client/workbench_server/http/http_server.h"

namespace touchstone::workbench {

// All functions may be called from any thread.
class Watchers : public std::enable_shared_from_this<Watchers> {
 public:
  // Sends the newest state, and every one after it, until the page goes.
  void Add(std::shared_ptr<Exchange> exchange);
  // `state` is JSON of an object.
  void Publish(std::string state);
  // A list that grows goes in parts: each watcher gets the items that it lacks. Clear begins another list.
  void Append(std::string item);
  void Clear();
  int count() const;

 private:
  struct Watcher {
    std::shared_ptr<Exchange> exchange;
    uint64_t version = 0, list = 0;
    size_t items = 0;
    bool writing = false, gone = false;
  };
  void Pump(const std::shared_ptr<Watcher>& watcher);
  void PumpAll();

  mutable std::mutex mutex_;  // guards what follows
  std::vector<std::shared_ptr<Watcher>> watchers_;
  std::string state_ = "{}";
  std::vector<std::string> items_;
  uint64_t version_ = 0, list_ = 1;  // version 0: nothing was published yet
};

}  // namespace touchstone::workbench
