#include "client/workbench_server/http/watchers.h"

#include <absl/strings/str_cat.h>

#include <algorithm>

#include <boost/beast/http/field.hpp>

namespace touchstone::workbench {

void Watchers::Add(std::shared_ptr<Exchange> exchange) {
  const auto watcher = std::make_shared<Watcher>();
  watcher->exchange = std::move(exchange);
  HttpFields fields;
  fields.set(boost::beast::http::field::content_type, "application/x-ndjson");
  watcher->exchange->Begin(std::move(fields));
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    watchers_.push_back(watcher);
  }
  watcher->exchange->OnGone([self = weak_from_this(), weak = std::weak_ptr<Watcher>(watcher)] {
    const auto watchers = self.lock();
    if (!watchers) return;
    const std::lock_guard<std::mutex> lock(watchers->mutex_);
    const auto gone = weak.lock();
    auto& all = watchers->watchers_;
    all.erase(std::remove(all.begin(), all.end(), gone), all.end());
  });
  Pump(watcher);
}

void Watchers::Publish(std::string state) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    state_ = std::move(state);
    ++version_;
  }
  PumpAll();
}

void Watchers::Append(std::string item) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    items_.push_back(std::move(item));
    ++version_;
  }
  PumpAll();
}

void Watchers::Clear() {
  const std::lock_guard<std::mutex> lock(mutex_);
  items_.clear();
  ++list_;
  ++version_;
}

int Watchers::count() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return static_cast<int>(watchers_.size());
}

void Watchers::PumpAll() {
  std::vector<std::shared_ptr<Watcher>> all;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    all = watchers_;
  }
  for (const auto& watcher : all) Pump(watcher);
}

void Watchers::Pump(const std::shared_ptr<Watcher>& watcher) {
  std::string line;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (watcher->writing || watcher->gone || watcher->version == version_) return;
    if (watcher->list != list_) watcher->items = 0;
    line = absl::StrCat("{\"state\":", state_, ",\"list\":", list_, ",\"first\":", watcher->items,
                        ",\"items\":[");
    for (size_t i = watcher->items; i < items_.size(); ++i)
      absl::StrAppend(&line, i > watcher->items ? "," : "", items_[i]);
    line += "]}\n";
    watcher->version = version_;
    watcher->list = list_;
    watcher->items = items_.size();
    watcher->writing = true;
  }
  watcher->exchange->Write(std::move(line), [self = shared_from_this(), watcher](bool taken) {
    {
      const std::lock_guard<std::mutex> lock(self->mutex_);
      watcher->writing = false;
      watcher->gone = !taken;
      if (!taken)
        self->watchers_.erase(std::remove(self->watchers_.begin(), self->watchers_.end(), watcher),
                              self->watchers_.end());
    }
    if (taken) self->Pump(watcher);
  });
}

}  // namespace touchstone::workbench
