// Dataset streams: batches, parts, resumption, cancellation.
#include <gmock/gmock.h>

#include <cstring>

#include "tests/conformance/conformance.h"

namespace touchstone {
namespace {

using testing::HasSubstr;

class StreamConformance : public Conformance {
 protected:
  v1::StreamDatasetRequest Request(uint64_t samples, uint32_t batch_size) const {
    v1::StreamDatasetRequest request;
    *request.mutable_spec() = SmallDataset(samples);
    request.set_batch_size(batch_size);
    return request;
  }
};

TEST_F(StreamConformance, TheHeaderComesFirstAndTellsTheColumns) {
  const Streamed streamed = Stream(Request(5, 2));
  ASSERT_TRUE(streamed.status.ok()) << streamed.status.error_message();
  EXPECT_EQ(streamed.header.samples(), 5u);
  EXPECT_EQ(streamed.header.fingers(), 3u);
  ASSERT_EQ(streamed.batches.size(), 3u);
  ASSERT_EQ(streamed.header.columns_size(), streamed.batches[0].columns_size());
  for (int k = 0; k < streamed.header.columns_size(); ++k)
    EXPECT_EQ(streamed.header.columns(k).name(), streamed.batches[0].columns(k).name());
}

TEST_F(StreamConformance, BatchesAreInOrderWithoutGapOrRepeat) {
  const Streamed streamed = Stream(Request(7, 3));
  ASSERT_TRUE(streamed.status.ok()) << streamed.status.error_message();
  uint64_t expected = 0;
  for (const v1::Batch& batch : streamed.batches) {
    EXPECT_EQ(batch.start_index(), expected);
    expected += batch.rows();
  }
  EXPECT_EQ(expected, 7u);
  const std::string bytes = ColumnBytes(streamed.batches, "index");
  for (uint64_t k = 0; k < 7; ++k) {
    uint64_t index;
    std::memcpy(&index, bytes.data() + 8 * k, 8);
    EXPECT_EQ(index, k);
  }
}

TEST_F(StreamConformance, APartIsThatPartOfTheWhole) {
  const Streamed whole = Stream(Request(9, 4));
  v1::StreamDatasetRequest request = Request(9, 2);
  request.set_start_index(3);
  request.set_stop_index(8);
  const Streamed part = Stream(request);
  ASSERT_TRUE(part.status.ok()) << part.status.error_message();
  const std::string poses = ColumnBytes(whole.batches, "approach");
  EXPECT_EQ(ColumnBytes(part.batches, "approach"), poses.substr(3 * 12, 5 * 12));
  if (IsVirtual()) {
    EXPECT_EQ(ColumnBytes(part.batches, "descriptor_s"),
              ColumnBytes(whole.batches, "descriptor_s").substr(3 * 12, 5 * 12));
  }
}

TEST_F(StreamConformance, SamplesOfAListAreThoseOfTheWholeInItsOrder) {
  const Streamed whole = Stream(Request(9, 4));
  v1::StreamDatasetRequest request = Request(9, 2);
  const std::vector<uint64_t> indices = {8, 0, 3, 3, 5};
  request.mutable_indices()->Assign(indices.begin(), indices.end());
  const Streamed listed = Stream(request);
  ASSERT_TRUE(listed.status.ok()) << listed.status.error_message();
  ASSERT_EQ(listed.batches.size(), 3u);
  EXPECT_EQ(listed.batches[2].start_index(), 4u);
  for (const std::string column : {"index", "approach", "descriptor_s"}) {
    // A rig touches sample 3 once: the journal answers for the second.
    const std::string all = ColumnBytes(whole.batches, column), some = ColumnBytes(listed.batches, column);
    const size_t bytes = all.size() / 9;
    std::string expected;
    for (const uint64_t index : indices) expected += all.substr(index * bytes, bytes);
    EXPECT_EQ(some, expected) << column;
  }
}

TEST_F(StreamConformance, ResumingAtTheEndGivesNothingAndNoError) {
  v1::StreamDatasetRequest request = Request(4, 2);
  request.set_start_index(4);
  const Streamed streamed = Stream(request);
  EXPECT_TRUE(streamed.status.ok()) << streamed.status.error_message();
  EXPECT_TRUE(streamed.batches.empty());
}

TEST_F(StreamConformance, StridedStreamsLeaveOutTheOthersBatches) {
  v1::StreamDatasetRequest request = Request(7, 2);
  request.set_start_index(2);
  request.set_batch_stride(2);
  const Streamed streamed = Stream(request);
  ASSERT_EQ(streamed.batches.size(), 2u);
  EXPECT_EQ(streamed.batches[0].start_index(), 2u);
  EXPECT_EQ(streamed.batches[1].start_index(), 6u);
  EXPECT_EQ(streamed.batches[1].rows(), 1u);
}

TEST_F(StreamConformance, ACancelledStreamEndsSoonAndTheSourceGoesOn) {
  grpc::ClientContext context;
  v1::StreamDatasetRequest request = Request(6000, 1);
  request.set_lease_token(LeaseToken());
  const auto reader = source_->StreamDataset(&context, request);
  v1::StreamDatasetResponse response;
  ASSERT_TRUE(reader->Read(&response));
  context.TryCancel();
  while (reader->Read(&response)) {
  }
  EXPECT_EQ(reader->Finish().error_code(), grpc::CANCELLED);
  // The source is free again within a batch.
  const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  v1::State state;
  do {
    grpc::ClientContext again;
    ASSERT_TRUE(control_->GetState(&again, {}, &state).ok());
  } while (state.running_streams() > 0 && std::chrono::steady_clock::now() < give_up);
  EXPECT_EQ(state.running_streams(), 0u);
}

TEST_F(StreamConformance, MistakesAreRefusedBeforeAnyBatch) {
  v1::StreamDatasetRequest unknown_object = Request(5, 1), unknown_column = Request(5, 1),
                           no_plan = Request(5, 1), beyond = Request(5, 1), huge_batch = Request(5, 1),
                           no_such_index = Request(5, 1), many_indices = Request(5, 1);
  unknown_object.mutable_spec()->set_objects(0, "lat99");
  unknown_column.mutable_spec()->add_columns("descripter");
  no_plan.mutable_spec()->clear_plan();
  beyond.set_stop_index(6);
  huge_batch.set_batch_size(description_.max_batch_size() + 1);
  no_such_index.add_indices(4);
  no_such_index.add_indices(5);
  many_indices.mutable_indices()->Resize(description_.max_indices_per_request() + 1, 0);
  const std::vector<std::tuple<v1::StreamDatasetRequest, grpc::StatusCode, std::string>> mistakes = {
      {unknown_object, grpc::NOT_FOUND, "lat99"},
      {unknown_column, grpc::INVALID_ARGUMENT, "did you mean 'descriptor'"},
      {no_plan, grpc::INVALID_ARGUMENT, "plan"},
      {beyond, grpc::OUT_OF_RANGE, "5 samples"},
      {huge_batch, grpc::RESOURCE_EXHAUSTED, "max_batch_size"},
      {no_such_index, grpc::OUT_OF_RANGE, "indices[1] = 5: the dataset has 5 samples"},
      {many_indices, grpc::RESOURCE_EXHAUSTED, "max_indices_per_request"},
  };
  for (const auto& [request, code, hint] : mistakes) {
    const Streamed streamed = Stream(request);
    EXPECT_EQ(streamed.status.error_code(), code) << streamed.status.error_message();
    EXPECT_THAT(streamed.status.error_message(), HasSubstr(hint));
    EXPECT_TRUE(streamed.batches.empty());
  }
}

}  // namespace
}  // namespace touchstone
