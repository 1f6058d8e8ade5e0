// What every source must do, virtual or physical, as tests that know nothing but an address.
//
// A program links the object library touchstone_conformance, calls SetConformanceTarget and runs gtest. Tests
// ask Describe what the source offers and skip, saying so, what it does not.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <thread>

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include "server/base/threads/manual_clock.h"
#include "touchstone/v1/control.grpc.pb.h"
#include "touchstone/v1/models.grpc.pb.h"
#include "touchstone/v1/source.grpc.pb.h"

namespace touchstone {

// HOST:PORT of the source under test, and the clock of its leases if it is in this process; set once, before the tests run.
void SetConformanceTarget(const std::string& address, ManualClock* clock = nullptr);

class Conformance : public testing::Test {
 protected:
  Conformance();
  ~Conformance() override;

  // A touch of the middle of the object's top from above, fingers across its x axis.
  v1::CommandedTouch TouchFromAbove(const v1::Object& object) const;
  // The first object, which every source has.
  v1::Object AnObject() const;
  v1::DatasetSpec SmallDataset(uint64_t samples) const;
  // Reads a whole stream; the status of its end.
  struct Streamed {
    v1::DatasetHeader header;
    std::vector<v1::Batch> batches;
    grpc::Status status;
  };
  Streamed Stream(v1::StreamDatasetRequest request);
  // Null: the source's time passes by itself.
  static ManualClock* clock();
  bool IsVirtual() const { return description_.kind() == v1::SOURCE_KIND_VIRTUAL; }
  // Where the source wants one: a lease, kept alive until the test ends, as every client has it. Else empty.
  std::string LeaseToken();

  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::Source::Stub> source_;
  std::unique_ptr<v1::Control::Stub> control_;
  v1::DescribeResponse description_;

 private:
  v1::Lease lease_;
  std::thread keeper_;
  std::atomic<bool> ending_{false};
};

// The data of one column over all batches, in order.
std::string ColumnBytes(const std::vector<v1::Batch>& batches, const std::string& column);

}  // namespace touchstone
