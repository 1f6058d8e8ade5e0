// Whether a dataset's files are what its dataset.json says: every byte of every shard.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

namespace touchstone::client {

struct DatasetCheck {
  uint64_t samples = 0;               // of the whole dataset
  uint64_t shards = 0;                // of the whole dataset
  uint64_t shards_whole = 0;          // there, and with the bytes that were written
  std::vector<std::string> missing;   // names of shards that are not there
  std::vector<std::string> changed;   // a sentence each: shards with other bytes
  std::vector<std::string> unlisted;  // names of shards of which no manifest says anything

  bool Whole() const { return shards_whole == shards && changed.empty() && unlisted.empty(); }
};

// Reads every shard in `folder`; `on_shard` is called after each with how many are read and how many there are. NOT_FOUND
// if there is no dataset.json (nor one of a parallel job), INVALID_ARGUMENT if it cannot be read.
absl::StatusOr<DatasetCheck> CheckDataset(const std::string& folder,
                                          const std::function<void(uint64_t, uint64_t)>& on_shard = {});

}  // namespace touchstone::client
