// A dataset as a stream of batches that survives the loss of its server: since a sample is a pure function of
// its index, the stream resumes at the same or another server where it stopped, without a gap or a repeat.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>

#include <absl/status/statusor.h>
#include <grpcpp/support/sync_stream.h>

#include "client/source/connection/connection.h"
#include "client/source/connection/lease_keeper.h"
#include "client/source/dataset/batch.h"
#include "server/base/threads/clock.h"

namespace touchstone::client {

struct DatasetStreamOptions {
  // A lost server is looked for, there and at the others, for this long since the last batch; then the stream
  // fails with UNAVAILABLE.
  double reconnect_s = kRetryForS;
  const Clock* clock = &SteadyClock();  // outlives the stream
  // Called from the reading thread when a server was lost and when the stream resumes.
  std::function<void(const std::string&)> log;
  // Of a source that needs a lease: its token now, and what keeps it when the stream resumes
  // elsewhere. Null: none.
  LeaseKeeper* lease = nullptr;
};

class DatasetStream {
 public:
  // Sends the request and waits for the header. `connection` must outlive the stream; two streams at once
  // need two connections.
  static absl::StatusOr<std::unique_ptr<DatasetStream>> Open(Connection* connection,
                                                             v1::StreamDatasetRequest request,
                                                             DatasetStreamOptions options = {});
  ~DatasetStream();  // cancels what is still under way

  const v1::DatasetHeader& header() const { return header_; }

  // The next batch, read into `batch`, whose buffers are reused: hand in the same one again. False at the
  // end. CANCELLED after Cancel.
  absl::StatusOr<bool> Next(Batch* batch);

  // Ends the stream; Next returns CANCELLED within a batch. Safe from any thread.
  void Cancel();

 private:
  DatasetStream(Connection* connection, v1::StreamDatasetRequest request, DatasetStreamOptions options);
  absl::Status Start();                       // one try: sends the request, reads and compares the header
  absl::Status Reconnect(absl::Status lost);  // nothing where it is no loss
  absl::Status CloseReader();                 // the stream's final status

  Connection* connection_;
  v1::StreamDatasetRequest request_;  // start_index moves on with every batch
  DatasetStreamOptions options_;
  v1::DatasetHeader header_;
  bool have_header_ = false;
  uint64_t batch_rows_ = 0;  // rows of a full batch, learned from the first
  std::atomic<bool> cancelled_{false};
  std::mutex context_mutex_;  // guards context_ against Cancel
  std::condition_variable cancellation_;
  std::unique_ptr<grpc::ClientContext> context_;
  std::unique_ptr<grpc::ClientReader<v1::StreamDatasetResponse>> reader_;
};

}  // namespace touchstone::client
