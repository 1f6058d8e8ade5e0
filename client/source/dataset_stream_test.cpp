// Streams from sources made here, which fail where a test wants it.
#include "client/source/dataset_stream.h"

#include <gmock/gmock.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <thread>

#include "client/source/connection/errors.h"
#include "server/base/test_tier.h"
#include "server/base/threads/manual_clock.h"
#include "server/service/rpc/server.h"

namespace touchstone::client {
namespace {

using ::testing::HasSubstr;

// A dataset whose only column is the index.
class FakeSource : public v1::Source::Service {
 public:
  explicit FakeSource(std::string model_hash = "abc") : model_hash_(std::move(model_hash)) {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }
  ~FakeSource() override { server_->Shutdown(std::chrono::system_clock::now()); }

  std::string address() const { return "127.0.0.1:" + std::to_string(port_); }

  grpc::Status StreamDataset(grpc::ServerContext* context, const v1::StreamDatasetRequest* request,
                             grpc::ServerWriter<v1::StreamDatasetResponse>* writer) override {
    requests.push_back(*request);
    v1::StreamDatasetResponse message;
    message.mutable_header()->set_samples(100);
    message.mutable_header()->set_model_hash(model_hash_);
    message.mutable_header()->set_model_yaml("name: nominal");
    writer->Write(message);
    const uint64_t stop = request->stop_index() > 0 ? request->stop_index() : 100;
    const uint64_t stride = std::max<uint32_t>(1, request->batch_stride());
    for (uint64_t i = request->start_index(); i < stop; i += request->batch_size() * stride) {
      if (batches_until_loss-- == 0) return grpc::Status(loss, "unplugged");
      if (context->IsCancelled()) return grpc::Status::CANCELLED;
      while (endless && i > 0 && !context->IsCancelled()) {
        ended = true;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
      message.Clear();
      v1::Batch* batch = message.mutable_batch();
      batch->set_start_index(i);
      const uint64_t rows = std::min<uint64_t>(request->batch_size(), stop - i);
      batch->set_rows(static_cast<uint32_t>(rows));
      std::vector<uint64_t> index(rows);
      for (uint64_t k = 0; k < rows; ++k) index[k] = i + k;
      v1::Column* column = batch->add_columns();
      column->set_name("index");
      column->set_type(v1::DATA_TYPE_UINT64);
      column->set_data(index.data(), rows * sizeof(uint64_t));
      if (!writer->Write(message)) return grpc::Status::CANCELLED;
    }
    return grpc::Status::OK;
  }

  int batches_until_loss = -1;
  grpc::StatusCode loss = grpc::StatusCode::UNAVAILABLE;
  bool endless = false;            // after the first batch none comes
  std::atomic<bool> ended{false};  // none comes any more
  std::vector<v1::StreamDatasetRequest> requests;

 private:
  std::string model_hash_;
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

v1::StreamDatasetRequest Request(uint32_t batch_size) {
  v1::StreamDatasetRequest request;
  request.set_batch_size(batch_size);
  return request;
}

std::unique_ptr<Connection> Connect(std::vector<std::string> servers) {
  ConnectionOptions options;
  options.servers = std::move(servers);
  options.connect_timeout_s = 60;  // what is gone is refused at once
  auto connection = Connection::Open(options);
  EXPECT_TRUE(connection.ok()) << connection.status();
  return std::move(*connection);
}

// The index column of the whole stream.
absl::StatusOr<std::vector<uint64_t>> ReadAll(DatasetStream* stream) {
  std::vector<uint64_t> all;
  Batch batch;
  while (true) {
    const absl::StatusOr<bool> more = stream->Next(&batch);
    if (!more.ok()) return more.status();
    if (!*more) return all;
    for (const uint64_t i : ValuesOf<uint64_t>(*batch.Find("index"))) all.push_back(i);
  }
}

std::vector<uint64_t> UpTo(uint64_t stop) {
  std::vector<uint64_t> all(stop);
  for (uint64_t i = 0; i < stop; ++i) all[i] = i;
  return all;
}

TEST(DatasetStream, ReadsAllBatchesInOrder) {
  FakeSource source;
  const auto connection = Connect({source.address()});
  auto stream = DatasetStream::Open(connection.get(), Request(7));
  ASSERT_TRUE(stream.ok()) << stream.status();
  EXPECT_EQ((*stream)->header().samples(), 100u);
  EXPECT_EQ(*ReadAll(stream->get()), UpTo(100));
}

TEST(DatasetStream, GoesOnAtAnotherServerWithoutAGapOrARepeat) {
  for (int loss = 0; loss < 15; ++loss) {
    FakeSource first, second;
    first.batches_until_loss = loss;
    const auto connection = Connect({first.address(), second.address()});
    auto stream = DatasetStream::Open(connection.get(), Request(7));
    ASSERT_TRUE(stream.ok()) << stream.status();
    const auto all = ReadAll(stream->get());
    ASSERT_TRUE(all.ok()) << all.status();
    EXPECT_EQ(*all, UpTo(100)) << "lost after " << loss << " batches";
    ASSERT_EQ(second.requests.size(), 1u);
    EXPECT_EQ(second.requests[0].spec().model().yaml(), "name: nominal") << "the model goes along";
  }
}

// A server cancels a stream that nobody read for minutes, and what is left when it is shut down.
TEST(DatasetStream, GoesOnWhereAServerCancelledIt) {
  FakeSource source;
  source.batches_until_loss = 4;
  source.loss = grpc::StatusCode::CANCELLED;
  const auto connection = Connect({source.address()});
  auto stream = DatasetStream::Open(connection.get(), Request(7));
  ASSERT_TRUE(stream.ok()) << stream.status();
  const auto all = ReadAll(stream->get());
  ASSERT_TRUE(all.ok()) << all.status();
  EXPECT_EQ(*all, UpTo(100));
}

TEST(Errors, OnlyAServerThatSaysSoIsWorthWaitingFor) {
  EXPECT_TRUE(IsFullServer(absl::ResourceExhaustedError(
      "256 dataset streams run already (max_streams = 256): try again later, or at another one")));
  EXPECT_FALSE(IsFullServer(absl::ResourceExhaustedError("batch_size = 9: at most 8 (max_batch_size)")));
  EXPECT_FALSE(IsFullServer(absl::InvalidArgumentError("try again")));
}

TEST(DatasetStream, GoesOnWithItsStride) {
  FakeSource first, second;
  first.batches_until_loss = 2;
  const auto connection = Connect({first.address(), second.address()});
  v1::StreamDatasetRequest request = Request(10);
  request.set_start_index(10);
  request.set_batch_stride(3);
  auto stream = DatasetStream::Open(connection.get(), request);
  const auto all = ReadAll(stream->get());
  ASSERT_TRUE(all.ok()) << all.status();
  std::vector<uint64_t> expected;
  for (const uint64_t start : {10, 40, 70})
    for (uint64_t i = start; i < start + 10; ++i) expected.push_back(i);
  EXPECT_EQ(*all, expected);
}

TEST(DatasetStream, RefusesAServerThatWouldGiveOtherBytes) {
  FakeSource first, second("def");
  first.batches_until_loss = 3;
  const auto connection = Connect({first.address(), second.address()});
  auto stream = DatasetStream::Open(connection.get(), Request(7));
  const auto all = ReadAll(stream->get());
  EXPECT_EQ(all.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(all.status().message()), HasSubstr("its model hash is def, it was abc"));
}

TEST(DatasetStream, GivesUpAfterTheTimeThatItWasGiven) {
  auto source = std::make_unique<FakeSource>();
  source->batches_until_loss = 3;
  const auto connection = Connect({source->address()});
  ManualClock clock;
  DatasetStreamOptions options;
  options.clock = &clock;
  auto stream = DatasetStream::Open(connection.get(), Request(7), options);
  ASSERT_TRUE(stream.ok());
  Batch batch;
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(*(*stream)->Next(&batch));
  source.reset();
  const Clock::Time lost = clock.Now();
  auto next = std::async(std::launch::async, [&] { return (*stream)->Next(&batch).status(); });
  clock.PassUntil([&] { return next.wait_for(std::chrono::seconds(0)) == std::future_status::ready; });
  EXPECT_EQ(next.get().code(), absl::StatusCode::kUnavailable);
  // It does not wait when the next wait, of 3 s by then, would be too long.
  EXPECT_LE(clock.SecondsSince(lost), options.reconnect_s);
  EXPECT_GT(clock.SecondsSince(lost), options.reconnect_s - 3);
}

TEST(DatasetStream, CancelEndsTheWaitForAServer) {
  auto source = std::make_unique<FakeSource>();
  source->batches_until_loss = 1;
  const auto connection = Connect({source->address()});
  const ManualClock clock;
  DatasetStreamOptions options;
  options.clock = &clock;
  auto stream = DatasetStream::Open(connection.get(), Request(7), options);
  Batch batch;
  ASSERT_TRUE(*(*stream)->Next(&batch));
  source.reset();
  auto next = std::async(std::launch::async, [&] { return (*stream)->Next(&batch).status(); });
  clock.AwaitWaiters();
  (*stream)->Cancel();
  EXPECT_EQ(next.get().code(), absl::StatusCode::kCancelled);
}

TEST(DatasetStream, CancelEndsItFromAnotherThread) {
  FakeSource source;
  source.endless = true;
  const auto connection = Connect({source.address()});
  auto stream = DatasetStream::Open(connection.get(), Request(1));
  Batch batch;
  ASSERT_TRUE(*(*stream)->Next(&batch));
  std::thread canceller([&] {
    while (!source.ended) std::this_thread::yield();
    (*stream)->Cancel();
  });
  const auto all = ReadAll(stream->get());
  canceller.join();
  EXPECT_EQ(all.status().code(), absl::StatusCode::kCancelled);
}

// Between two reads nobody looks at the connection but gRPC itself, every 5 s: signs of life are answered in time all the same,
// and the server takes so many of them for no attack.
TEST(DatasetStream, IsNotLostWhereItsReaderIsSlow) {
  TOUCHSTONE_SECOND_TIER("long: longer than a sign of life may take");
  service::ServerOptions options;
  options.listen = "127.0.0.1:0";
  options.supershape_triangles = 500;
  const auto server = service::Server::Start(options).value();
  const auto connection = Connect({"127.0.0.1:" + std::to_string(server->port())});
  v1::StreamDatasetRequest request = Request(500);
  request.mutable_spec()->add_objects("lat00");
  request.mutable_spec()->mutable_plan()->mutable_sphere();
  request.mutable_spec()->set_samples(1'000'000);
  request.mutable_spec()->add_columns("index");
  request.mutable_spec()->add_columns("pose");
  std::vector<std::string> losses;
  DatasetStreamOptions how;
  how.log = [&](const std::string& line) { losses.push_back(line); };
  auto stream = DatasetStream::Open(connection.get(), request, how);
  ASSERT_TRUE(stream.ok()) << stream.status();
  Batch batch;
  ASSERT_TRUE((*stream)->Next(&batch).value());
  std::this_thread::sleep_for(std::chrono::duration<double>(2 * (kKeepaliveS + kKeepaliveTimeoutS)));
  for (int k = 0; k < 1000; ++k) ASSERT_TRUE((*stream)->Next(&batch).value());
  EXPECT_THAT(losses, testing::IsEmpty());
}

TEST(Connection, SaysWhichServersDidNotAnswer) {
  ConnectionOptions options;
  options.servers = {"127.0.0.1:1", "127.0.0.1:2"};
  options.connect_timeout_s = 0.2;
  const auto connection = Connection::Open(options);
  EXPECT_EQ(connection.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(connection.status().message()),
              HasSubstr("no connection to 127.0.0.1:1; no connection to 127.0.0.1:2"));
}

TEST(Connection, RefusesWhatIsNoAddress) {
  for (const char* address : {"localhost", ":50051", "host:", "host:0", "host:70000", "host:12a"}) {
    ConnectionOptions options;
    options.servers = {address};
    EXPECT_EQ(Connection::Open(options).status().code(), absl::StatusCode::kInvalidArgument) << address;
  }
}

}  // namespace
}  // namespace touchstone::client
