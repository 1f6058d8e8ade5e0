// Requests and clients that ask for too much: each is refused with the limit's name and value, and nobody else notices.
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <grpc/grpc.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <fstream>
#include <thread>

#include "server/base/sanitizers.h"
#include "server/base/test_tier.h"
#include "server/base/threads/manual_clock.h"
#include "server/image/encoding/encode.h"
#include "server/service/rpc/server.h"
#include "touchstone/v1/control.grpc.pb.h"
#include "touchstone/v1/diagnosis.grpc.pb.h"
#include "touchstone/v1/models.grpc.pb.h"
#include "touchstone/v1/sessions.grpc.pb.h"
#include "touchstone/v1/source.grpc.pb.h"

namespace touchstone::service {
namespace {

using testing::HasSubstr;

class OverloadTest : public testing::Test {
 protected:
  // Where the last object of gRPC 1.51 ends, it waits up to ten seconds for a thread of its own that polls.
  static void SetUpTestSuite() { grpc_init(); }

  void Start(ServerOptions options = {}) {
    options.listen = "127.0.0.1:0";
    options.supershape_triangles = 2000;
    options.threads = 2;
    auto server = Server::Start(options);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    channel_ = NewChannel();
  }

  std::shared_ptr<grpc::Channel> NewChannel() const {
    grpc::ChannelArguments arguments;
    arguments.SetMaxSendMessageSize(-1);
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    return grpc::CreateCustomChannel(absl::StrCat("127.0.0.1:", server_->port()),
                                     grpc::InsecureChannelCredentials(), arguments);
  }

  // The status of a method for these bytes, whatever they are.
  grpc::Status CallRaw(const std::string& method, const std::string& bytes) {
    grpc::GenericStub stub(channel_);
    grpc::ClientContext context;
    const grpc::Slice slice(bytes);
    const grpc::ByteBuffer request(&slice, 1);
    grpc::ByteBuffer response;
    grpc::CompletionQueue queue;
    const auto call = stub.PrepareUnaryCall(&context, method, request, &queue);
    call->StartCall();
    grpc::Status status;
    call->Finish(&response, &status, nullptr);
    void* tag = nullptr;
    bool ok = false;
    queue.Next(&tag, &ok);
    return status;
  }

  grpc::Status Touch(const v1::TouchRequest& request) {
    grpc::ClientContext context;
    v1::TouchResponse response;
    return v1::Source::NewStub(channel_)->Touch(&context, request, &response);
  }

  static v1::StreamDatasetRequest Request(uint64_t samples) {
    v1::StreamDatasetRequest request;
    request.mutable_spec()->add_objects("lat20");
    request.mutable_spec()->mutable_plan()->mutable_sphere();
    request.mutable_spec()->set_samples(samples);
    return request;
  }

  grpc::Status Stream(const v1::StreamDatasetRequest& request) {
    grpc::ClientContext context;
    const auto reader = v1::Source::NewStub(channel_)->StreamDataset(&context, request);
    v1::StreamDatasetResponse response;
    while (reader->Read(&response)) {
    }
    return reader->Finish();
  }

  grpc::Status Compare(const std::string& csv) {
    v1::CompareRequest request;
    request.mutable_evidence()->set_csv(csv);
    grpc::ClientContext context;
    const auto reader = v1::Diagnosis::NewStub(channel_)->Compare(&context, request);
    v1::CompareResponse response;
    while (reader->Read(&response)) {
    }
    return reader->Finish();
  }

  grpc::Status CreateModel(const std::string& yaml) {
    v1::CreateModelRequest request;
    request.set_yaml(yaml);
    request.set_validate_only(true);
    grpc::ClientContext context;
    v1::Model model;
    return v1::Models::NewStub(channel_)->CreateModel(&context, request, &model);
  }

  v1::State GetState() {
    grpc::ClientContext context;
    v1::State state;
    EXPECT_TRUE(v1::Control::NewStub(channel_)->GetState(&context, {}, &state).ok());
    return state;
  }

  static void ExpectOver(const grpc::Status& status, const std::string& limit, const std::string& value) {
    EXPECT_EQ(status.error_code(), grpc::RESOURCE_EXHAUSTED) << status.error_message();
    EXPECT_THAT(status.error_message(), HasSubstr(limit));
    EXPECT_THAT(status.error_message(), HasSubstr(value));
  }

  ManualClock clock_;
  std::unique_ptr<Server> server_;
  std::shared_ptr<grpc::Channel> channel_;
};

// Of this process, at most so far.
uint64_t PeakMib() {
  std::ifstream file("/proc/self/status");
  for (std::string word; file >> word;)
    if (word == "VmHWM:") {
      uint64_t kib = 0;
      file >> kib;
      return kib / 1024;
    }
  return 0;
}

std::string Repeated(const std::string& piece, size_t times) {
  std::string text;
  text.reserve(piece.size() * times);
  for (size_t k = 0; k < times; ++k) text += piece;
  return text;
}

// "touches" is field 2, "evidence" field 1, and "meshes" in it field 4: an empty one takes two bytes on the wire and 100
// times as many in memory.
TEST_F(OverloadTest, EmptyElementsAreCountedBeforeTheyAreDecoded) {
  Start();
  const uint64_t before_mib = PeakMib();
  ExpectOver(CallRaw("/touchstone.v1.Source/Touch", Repeated(std::string("\x12\x00", 2), 2'000'000)),
             "max_touches_per_request", "2000000: at most 20000");
  const int meshes = v1::Evidence::kMeshesFieldNumber;
  std::string evidence = Repeated(std::string({static_cast<char>(meshes << 3 | 2), '\0'}), 10'000'000);
  std::string request = "\x0a";
  for (size_t left = evidence.size(); left > 0; left >>= 7)
    request += static_cast<char>((left & 0x7f) | (left > 0x7f ? 0x80 : 0));
  ExpectOver(CallRaw("/touchstone.v1.Diagnosis/Compare", request + evidence), "max_request_elements",
             "10000001: at most 200000");
  // Unknown fields are kept too.
  ExpectOver(CallRaw("/touchstone.v1.Source/Describe", Repeated(std::string("\x7a\x00", 2), 1'000'000)),
             "max_request_elements", "1000000: at most 200000");
  if (!kUnderSanitizers) {
    EXPECT_LT(PeakMib() - before_mib, 400u) << "10 million meshes would take 1000 MiB";
  }
}

TEST_F(OverloadTest, RequestsHaveASizeByTheirMethod) {
  Start();
  const std::string text(5 << 20, ' ');
  v1::CreateModelRequest model;
  model.set_yaml(text);
  ExpectOver(CallRaw("/touchstone.v1.Models/CreateModel", model.SerializeAsString()), "max_request_mib",
             "4194304");
  // An upload of the same size is looked at.
  EXPECT_EQ(Compare(text).error_code(), grpc::INVALID_ARGUMENT);
}

// As of a client that hangs up between its headers and its message.
TEST_F(OverloadTest, ACallWithoutAMessageIsRefused) {
  Start();
  for (const char* method : {"/touchstone.v1.Source/Describe", "/touchstone.v1.Source/StreamDataset",
                             "/touchstone.v1.Models/CreateModel", "/touchstone.v1.Control/Stop"}) {
    grpc::GenericStub stub(channel_);
    grpc::ClientContext context;
    grpc::CompletionQueue queue;
    grpc::Status status;
    void* tag = nullptr;
    bool ok = false;
    const auto call = stub.PrepareCall(&context, method, &queue);
    call->StartCall(nullptr);
    queue.Next(&tag, &ok);
    call->WritesDone(nullptr);
    queue.Next(&tag, &ok);
    call->Finish(&status, nullptr);
    queue.Next(&tag, &ok);
    // gRPC itself refuses those of a queue of their own (call_queue.h).
    const bool queued = absl::StrContains(method, "Control");
    EXPECT_EQ(status.error_code(), queued ? grpc::INTERNAL : grpc::INVALID_ARGUMENT)
        << method << ": " << status.error_message();
    EXPECT_NE(status.error_message(), "") << method;
  }
}

TEST_F(OverloadTest, WhatIsNoMessageIsRefusedAsSuch) {
  Start();
  for (const char* bytes : {"\x12", "\x0b\x12", "\xff\xff\xff\xff\xff\xff", "\x0a\x7f"})
    EXPECT_FALSE(CallRaw("/touchstone.v1.Source/Touch", bytes).ok());
  EXPECT_EQ(GetState().running_requests(), 0u);
}

TEST_F(OverloadTest, FilesOfEmptyLinesAndOfCommasTakeNoMemory) {
  TOUCHSTONE_SECOND_TIER("long: files as large as a server takes");
  Start();
  const std::string header =
      "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,"
      "approach_z,"
      "lateral_x,lateral_y,lateral_z,t_l_us,t_m_us,t_r_us\n";
  const uint64_t before_mib = PeakMib();
  const grpc::Status empty = Compare(header + std::string(20'000'000, '\n'));
  EXPECT_EQ(empty.error_code(), grpc::INVALID_ARGUMENT) << empty.error_message();
  EXPECT_THAT(empty.error_message(), HasSubstr("no touch"));
  EXPECT_THAT(Compare(std::string(20'000'000, ',')).error_message(), HasSubstr("fields"));
  if (!kUnderSanitizers) {
    EXPECT_LT(PeakMib() - before_mib, 300u);
  }
}

TEST_F(OverloadTest, MeasuredSetsKeepTheirLimits) {
  Start();
  std::string columns = "object,t_0_us";
  for (int k = 0; k < 63; ++k) absl::StrAppend(&columns, ",cov_", k);
  ExpectOver(Compare(columns + "\n"), "max_session_columns", "65: at most 64");
  std::string objects = "object,t_0_us\n";
  for (int k = 0; k < 1001; ++k) absl::StrAppend(&objects, "o", k, ",1\n");
  ExpectOver(Compare(objects), "max_session_objects", "1001: at most 1000");
  EXPECT_THAT(Compare("object,t_0_us,t_1_us\nlat20,0,1e300\n").error_message(),
              HasSubstr("1e300 is out of range"));
  EXPECT_THAT(Compare("object,t_0_us,t_1_us\nlat20,0,2e10\n").error_message(), HasSubstr("out of range"));
}

TEST_F(OverloadTest, DatasetsKeepTheirLimits) {
  Start();
  v1::StreamDatasetRequest fine = Request(10), many = Request(10), patient = Request(10);
  fine.mutable_spec()->mutable_plan()->mutable_sphere()->set_step_angle_rad(1e-5);
  ExpectOver(Stream(fine), "min_step_angle_rad", "0.001");
  for (int k = 0; k < 257; ++k) many.mutable_spec()->add_objects(absl::StrCat("o", k));
  ExpectOver(Stream(many), "max_objects", "258: at most 256");
  patient.mutable_spec()->set_max_draws(10'001);
  ExpectOver(Stream(patient), "max_draws", "10001: at most 10000");
  // The same object again is no other one.
  v1::StreamDatasetRequest same = Request(1000);
  for (int k = 0; k < 299; ++k) same.mutable_spec()->add_objects("lat20");
  EXPECT_TRUE(Stream(same).ok());
}

TEST_F(OverloadTest, ModelsKeepTheirLimits) {
  Start();
  const std::string head = "touchstone: model/1\nname: m\n";
  ExpectOver(CreateModel(head + "#" + std::string(257 << 10, ' ')), "max_model_kib", "258: at most 256");
  ExpectOver(CreateModel(head + "effects: [" + Repeated("x, ", 20'001) + "x]\n"), "max_model_nodes", "20000");
  std::string objects;
  for (int k = 0; k < 1001; ++k) absl::StrAppend(&objects, "o", k, ": {relative: 0.01}, ");
  ExpectOver(CreateModel(head + "effects: [{object_scale: {scope: object, objects: {" + objects + "}}}]\n"),
             "max_model_objects", "1001: at most 1000");
}

TEST_F(OverloadTest, OneClientDoesNotTakeAllStreams) {
  ServerOptions options;
  options.max_streams = 4;
  options.max_streams_per_client = 2;
  Start(options);
  const auto stub = v1::Source::NewStub(channel_);
  grpc::ClientContext contexts[2];
  std::unique_ptr<grpc::ClientReader<v1::StreamDatasetResponse>> readers[2];
  v1::StreamDatasetResponse response;
  for (int k = 0; k < 2; ++k) {
    readers[k] = stub->StreamDataset(&contexts[k], Request(100'000'000));
    ASSERT_TRUE(readers[k]->Read(&response));
  }
  const grpc::Status third = Stream(Request(10));
  ExpectOver(third, "max_streams_per_client = 2", "try again");
  // Another client, here one in the same process, has room.
  grpc::ClientContext other;
  const auto reader = v1::Source::NewStub(server_->InProcessChannel())->StreamDataset(&other, Request(10));
  while (reader->Read(&response)) {
  }
  EXPECT_TRUE(reader->Finish().ok());
  for (int k = 0; k < 2; ++k) {
    contexts[k].TryCancel();
    readers[k]->Finish();
  }
}

TEST_F(OverloadTest, AStreamThatNobodyReadsIsCancelled) {
  ServerOptions options;
  options.clock = &clock_;
  Start(options);
  grpc::ClientContext context;
  const auto reader = v1::Source::NewStub(channel_)->StreamDataset(&context, Request(100'000'000));
  v1::StreamDatasetResponse response;
  ASSERT_TRUE(reader->Read(&response));
  const auto read = clock_.Now();
  while (GetState().running_streams() > 0) clock_.Advance(1);
  EXPECT_GT(clock_.SecondsSince(read), options.stall_s);
  while (reader->Read(&response)) {
  }
  EXPECT_EQ(reader->Finish().error_code(), grpc::CANCELLED);
}

TEST_F(OverloadTest, UploadsAreFewAtOnce) {
  ServerOptions options;
  options.max_uploads = 2;
  Start(options);
  const auto stub = v1::Sessions::NewStub(channel_);
  grpc::ClientContext contexts[3];
  v1::Session sessions[3];
  std::unique_ptr<grpc::ClientWriter<v1::CreateSessionRequest>> writers[3];
  v1::CreateSessionRequest request;
  request.set_name("large");
  request.set_csv("object,t_0_us\n");
  for (int k = 0; k < 2; ++k) {
    writers[k] = stub->CreateSession(&contexts[k], &sessions[k]);
    ASSERT_TRUE(writers[k]->Write(request));
  }
  while (GetState().running_requests() < 2) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  writers[2] = stub->CreateSession(&contexts[2], &sessions[2]);
  ExpectOver(writers[2]->Finish(), "max_uploads = 2", "try again");
  for (int k = 0; k < 2; ++k) {
    contexts[k].TryCancel();
    writers[k]->Finish();
  }
}

TEST_F(OverloadTest, AnUploadOfWhichNothingMoreComesIsCancelled) {
  ServerOptions options;
  options.clock = &clock_;
  Start(options);
  grpc::ClientContext context;
  v1::Session session;
  const auto writer = v1::Sessions::NewStub(channel_)->CreateSession(&context, &session);
  v1::CreateSessionRequest request;
  request.set_name("large");
  request.set_csv("object,t_0_us\n");
  writer->Write(request);
  while (GetState().running_requests() == 0) std::this_thread::yield();
  const auto begun = clock_.Now();
  while (GetState().running_requests() > 0) clock_.Advance(1);
  EXPECT_GT(clock_.SecondsSince(begun), options.stall_s);
  EXPECT_EQ(writer->Finish().error_code(), grpc::CANCELLED);
}

TEST_F(OverloadTest, WhatThereIsNoMemoryForIsRefusedAndAStopIsNot) {
  ServerOptions options;
  options.max_memory_mib = 2;
  Start(options);
  v1::TouchRequest request;
  request.set_object("lat20");
  for (int k = 0; k < 15'000; ++k) request.add_touches();
  ExpectOver(Touch(request), "max_memory_mib = 2", "try again");
  grpc::ClientContext context;
  v1::StopResponse stopped;
  EXPECT_TRUE(v1::Control::NewStub(channel_)->Stop(&context, {}, &stopped).ok());
}

// 20 kB of one grey stand for 4 MiB: what a client sends says little about what it takes.
TEST_F(OverloadTest, PicturesOfAnUploadCountAsTheirPixels) {
  ServerOptions options;
  options.max_memory_mib = 8;
  Start(options);
  const int side = image::kMaxImageSide;
  const std::vector<uint8_t> pixels(size_t{1} * side * side);
  grpc::ClientContext context;
  v1::Session session;
  const auto writer = v1::Sessions::NewStub(channel_)->CreateSession(&context, &session);
  v1::CreateSessionRequest request;
  request.set_name("flat");
  request.set_csv(*image::EncodePng(pixels.data(), side, side, 1));
  for (int k = 0; k < 3; ++k) {
    request.set_file(absl::StrCat(k, ".png"));
    ASSERT_TRUE(writer->Write(request));
  }
  writer->WritesDone();
  ExpectOver(writer->Finish(), "max_memory_mib = 8", "13 more would be needed");
}

TEST_F(OverloadTest, ADiagnosisEndsAfterItsTime) {
  ServerOptions options;
  options.max_diagnosis_s = 0.01;
  Start(options);
  std::string csv =
      "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,approach_y,"
      "approach_z,"
      "lateral_x,lateral_y,lateral_z,t_l_us,t_m_us,t_r_us\n";
  // Times of the size that the model expects, or the units would be doubted before anything takes long.
  for (int k = 0; k < 20'000; ++k)
    absl::StrAppend(&csv, k, ",lat20,20,100,", k % 17, ",", k % 13, ",", k % 5, ",0,0,-1,1,0,0,",
                    k * 7919 % 101, ",", k * 104729 % 101, ",0\n");
  v1::DiagnoseRequest request;
  request.mutable_evidence()->set_csv(csv);
  grpc::ClientContext context;
  const auto reader = v1::Diagnosis::NewStub(channel_)->Diagnose(&context, request);
  v1::DiagnoseResponse response;
  while (reader->Read(&response)) {
  }
  ExpectOver(reader->Finish(), "max_diagnosis_s", "0.01");
}

TEST_F(OverloadTest, AClientMakesSoManyCallsASecondAndCanStopAllTheSame) {
  ServerOptions options;
  options.max_unary_calls_per_s = 1;  // five at once
  options.clock = &clock_;
  Start(options);
  const auto describe = [&] {
    grpc::ClientContext context;
    v1::DescribeResponse response;
    return v1::Source::NewStub(channel_)->Describe(&context, {}, &response);
  };
  for (int call = 0; call < 5; ++call) EXPECT_TRUE(describe().ok());
  const grpc::Status refused = describe();
  ExpectOver(refused, "max_unary_calls_per_s", "1");
  EXPECT_THAT(refused.error_message(), HasSubstr("try again"));
  clock_.Advance(1);
  EXPECT_TRUE(describe().ok());
  EXPECT_FALSE(describe().ok());
  grpc::ClientContext context;
  v1::StopResponse stopped;
  EXPECT_TRUE(v1::Control::NewStub(channel_)->Stop(&context, {}, &stopped).ok());
}

TEST_F(OverloadTest, CalculatingForOneCallEndsInTime) {
  ServerOptions options;
  options.max_unary_s = 0.01;
  Start(options);
  std::string yaml = "touchstone: model/1\nname: slow\neffects:\n";
  for (int k = 0; k < 60; ++k)
    absl::StrAppend(&yaml, "  - formula: {name: f", k,
                    ", adds: time_us, expression: \"k*sin(travel_mm)*cos(finger+", k,
                    ")*exp(sin(travel_mm))\", parameters: {k: {value: 1, unit: us, min: -9, max: 9}}}\n");
  v1::TouchRequest request;
  request.set_object("lat00");
  request.mutable_model()->set_yaml(yaml);
  for (int k = 0; k < 20'000; ++k) {
    v1::CommandedTouch& touch = *request.add_touches();
    touch.mutable_approach()->set_x(-1);
    touch.mutable_lateral()->set_y(1);
    touch.mutable_target_m();
    touch.set_standoff_m(0.2);
    touch.set_speed_m_s(0.02);
  }
  grpc::ClientContext context;
  v1::TouchResponse response;
  ExpectOver(v1::Source::NewStub(channel_)->Touch(&context, request, &response), "max_unary_s", "0.01");
}

TEST_F(OverloadTest, AnEndlessStreamIsHandedOverWhenTheServerDrains) {
  ServerOptions options;
  options.drain_s = 600;  // nobody waits for it
  options.clock = &clock_;
  Start(options);
  grpc::ClientContext context;
  const auto reader = v1::Source::NewStub(channel_)->StreamDataset(&context, Request(uint64_t{1} << 40));
  v1::StreamDatasetResponse response;
  ASSERT_TRUE(reader->Read(&response));
  std::thread drain([&] { server_->Drain(); });
  uint64_t next = 0;
  while (reader->Read(&response)) {
    next = response.batch().start_index() + response.batch().rows();
    clock_.Advance(0.1);
  }
  const grpc::Status status = reader->Finish();
  drain.join();
  EXPECT_EQ(status.error_code(), grpc::UNAVAILABLE) << status.error_message();
  EXPECT_THAT(status.error_message(), HasSubstr(absl::StrCat("go on with sample ", next)));
}

// Twenty streams of a slow model, and what else is asked for meanwhile, on two threads.
class SlowStreamsTest : public OverloadTest {
 protected:
  static constexpr int kSlow = 20;

  void SetUp() override {
    Start();
    std::string yaml = "touchstone: model/1\nname: slow\neffects:\n";
    for (int k = 0; k < 20; ++k)
      absl::StrAppend(&yaml, "  - formula: {name: f", k,
                      ", adds: time_us, expression: \"k*sin(travel_mm)*cos(finger+", k,
                      ")*exp(sin(travel_mm))\", parameters: {k: {value: 1, unit: us, min: -9, max: 9}}}\n");
    v1::StreamDatasetRequest slow = Request(100'000'000);
    slow.mutable_spec()->mutable_model()->set_yaml(yaml);
    const auto stub = v1::Source::NewStub(channel_);
    for (int k = 0; k < kSlow; ++k) {
      contexts_.push_back(std::make_unique<grpc::ClientContext>());
      readers_.push_back(stub->StreamDataset(contexts_.back().get(), slow));
    }
    // Header and first batch: each has work in the pool by then, and always more.
    v1::StreamDatasetResponse response;
    for (const auto& reader : readers_) ASSERT_TRUE(reader->Read(&response) && reader->Read(&response));
  }
  void TearDown() override {
    for (const auto& context : contexts_) context->TryCancel();
    for (const auto& each : readers_) each->Finish();
  }

  // Reads a small dataset; returns how many touches the slow streams made from its header until its only batch was there.
  uint64_t SlowTouchesUntilSmallDatasetThrough(const std::shared_ptr<grpc::Channel>& channel) {
    grpc::ClientContext context;
    const auto reader = v1::Source::NewStub(channel)->StreamDataset(&context, Request(100));
    v1::StreamDatasetResponse response;
    EXPECT_TRUE(reader->Read(&response) && response.has_header());
    const uint64_t before = GetState().touches();
    EXPECT_TRUE(reader->Read(&response));
    const uint64_t after = GetState().touches();
    EXPECT_EQ(response.batch().rows(), 100u);
    EXPECT_FALSE(reader->Read(&response));
    EXPECT_TRUE(reader->Finish().ok());
    return after - before;
  }

  std::vector<std::unique_ptr<grpc::ClientContext>> contexts_;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::StreamDatasetResponse>>> readers_;
};

// Fewer than half of them have had a turn: in the order of the requests all would have had several.
TEST_F(SlowStreamsTest, AnotherClientDoesNotWaitForThem) {
  EXPECT_LT(SlowTouchesUntilSmallDatasetThrough(server_->InProcessChannel()), kSlow / 2 * 8192u);
}

TEST_F(SlowStreamsTest, AnotherStreamOfTheirClientDoesNotWaitForThem) {
  EXPECT_LT(SlowTouchesUntilSmallDatasetThrough(channel_), kSlow / 2 * 8192u);
}

}  // namespace
}  // namespace touchstone::service
