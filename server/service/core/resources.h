// What the services share: objects, models, the thread pool, the limits, the counters.
#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/base/process/version.h"
#include "server/base/threads/thread_pool.h"
#include "server/model/model.h"
#include "server/service/core/access.h"
#include "server/service/core/admission.h"
#include "server/service/core/metrics.h"
#include "server/service/options/server_options.h"
#include "server/service/sessions/session_store.h"
#include "server/source/object_store.h"

namespace touchstone::service {

// Models by name and by hash. A name never changes its meaning. With a folder, models are files there, so
// that replicas that share it serve the same ones. A file there that is no model is left where it is, with a warning: what
// is wrong with one model must not keep the others from being served.
class ModelStore {
 public:
  // INVALID_ARGUMENT if the folder cannot be made.
  static absl::StatusOr<std::unique_ptr<ModelStore>> Open(const std::string& folder);

  absl::StatusOr<std::shared_ptr<const model::Model>> FindByName(const std::string& name) const;
  absl::StatusOr<std::shared_ptr<const model::Model>> FindByHash(const std::string& prefix) const;
  // 1 to 64 letters, digits, '_', '-' or '.', not '.' first.
  static absl::Status CheckName(const std::string& name);
  // Once this is OK the model is kept: it is on the disk and was read back. ALREADY_EXISTS if the name stands for another
  // one, INVALID_ARGUMENT if its file could not be read again.
  absl::Status Create(const model::Model& model);
  // By name, those behind `name` in the order of bytes; empty: all.
  std::vector<std::shared_ptr<const model::Model>> Behind(const std::string& name) const;

 private:
  void Refresh() const;  // reads files that appeared
  absl::Status CheckSame(const model::Model& kept, const model::Model& model) const;

  std::string folder_;
  mutable std::mutex mutex_;
  mutable std::map<std::string, std::shared_ptr<const model::Model>> models_;
  mutable std::map<std::string, std::filesystem::file_time_type>
      refused_;  // files that are no models, as of then
};

struct Resources {
  // What calls share out among themselves, as the options say.
  void OpenPlaces();

  ServerOptions options;
  std::unique_ptr<CallMetrics> calls;  // counted there, if anybody asks; set before the server starts
  std::unique_ptr<Access> access;      // who may call; set before the server starts
  std::unique_ptr<Places> streams, uploads, diagnoses;
  std::unique_ptr<CallRate> rate;
  std::unique_ptr<MemoryBudget> memory;
  std::unique_ptr<StallWatch> stalls;
  std::unique_ptr<ThreadPool> pool;
  source::ObjectStore objects;
  std::unique_ptr<ModelStore> models;
  std::unique_ptr<SessionStore> sessions;
  std::shared_ptr<const model::Model> default_model;  // null: this process simulates nothing

  std::atomic<bool> draining{false};
  std::atomic<uint64_t> stop_count{0};  // grows with every Stop; running touches compare
  std::atomic<uint32_t> running_requests{0};
  std::atomic<uint32_t> running_streams{0};
  std::atomic<uint64_t> samples{0};  // of datasets
  std::atomic<uint64_t> touches{0};
  std::atomic<uint64_t> images{0};
  std::atomic<double> last_comparison_rmse_us{std::numeric_limits<double>::quiet_NaN()};  // of touches
  std::chrono::steady_clock::time_point started = std::chrono::steady_clock::now();
};

// Counts a running call while it lives.
class RunningGuard {
 public:
  explicit RunningGuard(std::atomic<uint32_t>* counter) : counter_(counter) { ++*counter_; }
  ~RunningGuard() { --*counter_; }
  RunningGuard(const RunningGuard&) = delete;
  RunningGuard& operator=(const RunningGuard&) = delete;

 private:
  std::atomic<uint32_t>* counter_;
};

}  // namespace touchstone::service
