// The server as a whole, beyond what every source must do (tests/conformance): replicas, slow readers, drain,
// store.
#include "server/service/rpc/server.h"

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include "server/base/test_folder.h"
#include "touchstone/v1/control.grpc.pb.h"
#include "touchstone/v1/models.grpc.pb.h"
#include "touchstone/v1/source.grpc.pb.h"

namespace touchstone::service {
namespace {

using testing::HasSubstr;

ServerOptions SmallServer() {
  ServerOptions options;
  options.listen = "127.0.0.1:0";
  options.supershape_triangles = 2000;
  options.threads = 2;
  return options;
}

std::unique_ptr<Server> StartServer(const ServerOptions& options) {
  auto server = Server::Start(options);
  EXPECT_TRUE(server.ok()) << server.status();
  return *std::move(server);
}

v1::StreamDatasetRequest Request(uint64_t samples, uint32_t batch_size) {
  v1::StreamDatasetRequest request;
  v1::DatasetSpec* spec = request.mutable_spec();
  spec->add_objects("lat00");
  spec->add_objects("lat20");
  spec->mutable_plan()->mutable_sphere();
  spec->set_samples(samples);
  spec->set_seed(3);
  request.set_batch_size(batch_size);
  return request;
}

std::string Descriptors(const std::shared_ptr<grpc::Channel>& channel,
                        const v1::StreamDatasetRequest& request) {
  const auto stub = v1::Source::NewStub(channel);
  grpc::ClientContext context;
  const auto reader = stub->StreamDataset(&context, request);
  v1::StreamDatasetResponse response;
  std::string bytes;
  while (reader->Read(&response))
    for (const v1::Column& column : response.batch().columns())
      if (column.name() == "descriptor_s") bytes += column.data();
  const grpc::Status status = reader->Finish();
  EXPECT_TRUE(status.ok()) << status.error_message();
  return bytes;
}

std::shared_ptr<grpc::Channel> ChannelTo(const Server& server) {
  return grpc::CreateChannel("127.0.0.1:" + std::to_string(server.port()),
                             grpc::InsecureChannelCredentials());
}

TEST(Server, TwoReplicasAndTheEmbeddedOneGiveTheSameBytes) {
  ServerOptions one_thread = SmallServer(), embedded = SmallServer();
  one_thread.threads = 1;
  embedded.listen = "";
  const auto first = StartServer(SmallServer()), second = StartServer(one_thread),
             third = StartServer(embedded);
  const std::string whole = Descriptors(ChannelTo(*first), Request(20000, 4096));
  EXPECT_EQ(whole.size(), 20000u * 12u);
  EXPECT_EQ(Descriptors(ChannelTo(*second), Request(20000, 1)), whole);
  EXPECT_EQ(Descriptors(third->InProcessChannel(), Request(20000, 777)), whole);
  // Lost after the first half, gone on at the other replica: neither gap nor repeat.
  v1::StreamDatasetRequest head = Request(20000, 4096), tail = Request(20000, 1000);
  head.set_stop_index(9001);
  tail.set_start_index(9001);
  EXPECT_EQ(Descriptors(ChannelTo(*first), head) + Descriptors(ChannelTo(*second), tail), whole);
}

TEST(Server, ASlowReaderHoldsBackOnlyItself) {
  const auto server = StartServer(SmallServer());
  const auto stub = v1::Source::NewStub(ChannelTo(*server));
  grpc::ClientContext slow_context;
  const auto slow = stub->StreamDataset(&slow_context, Request(100'000'000, 4096));
  v1::StreamDatasetResponse response;
  ASSERT_TRUE(slow->Read(&response));
  // And reads no more. Others have their streams meanwhile, also once its buffers are full and nothing is made for it.
  const auto control = v1::Control::NewStub(ChannelTo(*server));
  const auto touches = [&] {
    v1::State state;
    grpc::ClientContext context;
    EXPECT_TRUE(control->GetState(&context, {}, &state).ok());
    return state.touches();
  };
  constexpr uint64_t kSamples = 200'000;
  uint64_t before = 0, after = touches();
  do {
    before = after;
    ASSERT_EQ(Descriptors(ChannelTo(*server), Request(kSamples, 4096)).size(), kSamples * 12);
    after = touches();
  } while (before == 0 || after != before + kSamples);
  slow_context.TryCancel();
  while (slow->Read(&response)) {
  }
  slow->Finish();
}

TEST(Server, MoreStreamsThanTheLimitAreRefusedAndSaySo) {
  ServerOptions options = SmallServer();
  options.max_streams = 1;
  const auto server = StartServer(options);
  const auto stub = v1::Source::NewStub(ChannelTo(*server));
  grpc::ClientContext first_context, second_context;
  const auto first = stub->StreamDataset(&first_context, Request(100'000'000, 4096));
  v1::StreamDatasetResponse response;
  ASSERT_TRUE(first->Read(&response));
  const auto second = stub->StreamDataset(&second_context, Request(10, 10));
  EXPECT_FALSE(second->Read(&response));
  const grpc::Status status = second->Finish();
  EXPECT_EQ(status.error_code(), grpc::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(), HasSubstr("max_streams"));
  first_context.TryCancel();
  first->Finish();
}

TEST(Server, DrainLetsAStreamFinishAndTakesNoNewCalls) {
  ServerOptions options = SmallServer();
  options.drain_s = 600;  // on a busy machine too, the stream fits into it
  const auto server = StartServer(options);
  const auto stub = v1::Source::NewStub(ChannelTo(*server));
  grpc::ClientContext context;
  const auto reader = stub->StreamDataset(&context, Request(100000, 4096));
  v1::StreamDatasetResponse response;
  ASSERT_TRUE(reader->Read(&response));
  std::thread drain([&] { server->Drain(); });
  uint64_t rows = 0;
  while (reader->Read(&response)) rows += response.batch().rows();
  EXPECT_TRUE(reader->Finish().ok());
  EXPECT_EQ(rows, 100000u);
  drain.join();
  grpc::ClientContext late;
  v1::DescribeResponse description;
  EXPECT_EQ(stub->Describe(&late, {}, &description).error_code(), grpc::UNAVAILABLE);
}

TEST(Server, KeepsModelsInItsFolderAndNeverChangesOne) {
  const std::string folder = testing::TempDir() + "/touchstone_models";
  std::filesystem::remove_all(folder);
  ServerOptions options = SmallServer();
  options.models_dir = folder;
  const std::string yaml = "touchstone: model/1\nname: mine\neffects:\n  - tip_radius: {radius_mm: 1.5}\n";
  std::string hash;
  {
    const auto server = StartServer(options);
    const auto replica = StartServer(options);
    const auto stub = v1::Models::NewStub(ChannelTo(*server));
    v1::CreateModelRequest request;
    request.set_yaml(yaml);
    v1::Model model;
    grpc::ClientContext first, second, third;
    ASSERT_TRUE(stub->CreateModel(&first, request, &model).ok());
    hash = model.hash();
    request.set_yaml("touchstone: model/1\nname: mine\neffects:\n  - tip_radius: {radius_mm: 1.6}\n");
    const grpc::Status status = stub->CreateModel(&second, request, &model);
    EXPECT_EQ(status.error_code(), grpc::ALREADY_EXISTS);
    EXPECT_THAT(status.error_message(), HasSubstr("never changes"));
    v1::GetModelRequest get;
    get.mutable_model()->set_name("mine");
    EXPECT_TRUE(v1::Models::NewStub(ChannelTo(*replica))->GetModel(&third, get, &model).ok());
    EXPECT_EQ(model.hash(), hash);
  }
  const auto again = StartServer(options);
  v1::GetModelRequest get;
  get.mutable_model()->set_hash(hash.substr(0, 10));
  v1::Model model;
  grpc::ClientContext context;
  ASSERT_TRUE(v1::Models::NewStub(ChannelTo(*again))->GetModel(&context, get, &model).ok());
  EXPECT_EQ(model.name(), "mine");
}

// The next start serves every model that was acknowledged, whatever else lies in the folder.
TEST(Server, StartsBesideFilesThatAreNoModels) {
  const TestFolder folder;
  ServerOptions options = SmallServer();
  options.models_dir = folder.path();
  v1::CreateModelRequest request;
  request.set_yaml("touchstone: model/1\nname: mine\neffects: []\n");
  v1::Model model;
  {
    const auto server = StartServer(options);
    grpc::ClientContext context;
    ASSERT_TRUE(v1::Models::NewStub(ChannelTo(*server))->CreateModel(&context, request, &model).ok());
  }
  std::ofstream(folder.Path("torn.yaml")) << "touchstone: model/1\nname: torn\neffects: [{tip_radius: {rad";
  std::ofstream(folder.Path("binary.yaml")) << std::string(1000, '\0');
  std::ofstream(folder.Path("huge.yaml")) << std::string(2 << 20, '#');
  std::filesystem::create_directories(folder.Path("folder.yaml"));
  const auto server = StartServer(options);
  const auto stub = v1::Models::NewStub(ChannelTo(*server));
  v1::GetModelRequest get;
  get.mutable_model()->set_name("mine");
  grpc::ClientContext found, in_the_way;
  EXPECT_TRUE(stub->GetModel(&found, get, &model).ok());
  // A name whose file is no model is not written over.
  request.set_yaml("touchstone: model/1\nname: torn\neffects: []\n");
  const grpc::Status status = stub->CreateModel(&in_the_way, request, &model);
  EXPECT_EQ(status.error_code(), grpc::FAILED_PRECONDITION);
  EXPECT_THAT(status.error_message(), HasSubstr("torn.yaml"));
}

TEST(Server, RefusesAModelThatItCouldNotReadAgain) {
  std::string objects;
  for (int k = 0; k < 9000; ++k) objects += "lat" + std::to_string(k) + ": {translation_mm: [1, 2, 3]}, ";
  const std::string yaml =
      "touchstone: model/1\nname: many\neffects: [{object_pose: {scope: object, objects: {" + objects +
      "}}}]\n";
  const TestFolder folder;
  ServerOptions options = SmallServer();
  options.max_model_kib = 1024;  // as large as any file that is read
  options.max_model_nodes = options.max_model_objects = 100'000;
  options.models_dir = folder.path();
  {
    const auto server = StartServer(options);
    v1::CreateModelRequest request;
    request.set_yaml(yaml);
    v1::Model model;
    grpc::ClientContext context;
    const grpc::Status status =
        v1::Models::NewStub(ChannelTo(*server))->CreateModel(&context, request, &model);
    EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT);
    EXPECT_THAT(status.error_message(), HasSubstr("could not be read again"));
  }
  EXPECT_TRUE(Server::Start(options).ok());
}

TEST(Server, OfTwoReplicasGivenTwoModelsOfOneNameOneKeepsItsOwn) {
  const TestFolder folder;
  ServerOptions options = SmallServer();
  options.models_dir = folder.path();
  const auto one = StartServer(options), other = StartServer(options);
  for (int round = 0; round < 20; ++round) {
    const std::string name = "model" + std::to_string(round);
    std::string hashes[2];
    const auto create = [&](const Server& server, int which) {
      v1::CreateModelRequest request;
      request.set_yaml("touchstone: model/1\nname: " + name + "\neffects:\n  - tip_radius: {radius_mm: 1." +
                       std::to_string(which + 1) + "}\n");
      v1::Model model;
      grpc::ClientContext context;
      if (v1::Models::NewStub(ChannelTo(server))->CreateModel(&context, request, &model).ok())
        hashes[which] = model.hash();
    };
    std::thread beside([&] { create(*one, 0); });
    create(*other, 1);
    beside.join();
    EXPECT_NE(hashes[0].empty(), hashes[1].empty()) << "both or neither of two models were acknowledged";
    for (const Server* server : {one.get(), other.get()}) {
      v1::GetModelRequest get;
      get.mutable_model()->set_name(name);
      v1::Model model;
      grpc::ClientContext context;
      ASSERT_TRUE(v1::Models::NewStub(ChannelTo(*server))->GetModel(&context, get, &model).ok());
      EXPECT_EQ(model.hash(), hashes[0] + hashes[1]);
    }
  }
}

TEST(Server, AnInlineModelNeedsNoStore) {
  const auto server = StartServer(SmallServer());
  v1::StreamDatasetRequest with = Request(1000, 1000);
  with.mutable_spec()->mutable_model()->set_yaml(
      "touchstone: model/1\nname: x\neffects:\n  - gaussian_noise: {sigma_us: 5000}\n");
  EXPECT_NE(Descriptors(ChannelTo(*server), with), Descriptors(ChannelTo(*server), Request(1000, 1000)));
}

TEST(Server, RefusesToStartOnWhatItCannotServe) {
  ServerOptions absent = SmallServer(), threads = SmallServer(), taken = SmallServer(),
                truncated = SmallServer();
  absent.meshes.push_back({"cup", "/no/such/cup.off"});
  EXPECT_THAT(std::string(Server::Start(absent).status().message()), HasSubstr("/no/such/cup.off"));
  threads.threads = -1;
  EXPECT_THAT(std::string(Server::Start(threads).status().message()), HasSubstr("threads = -1"));
  const std::string path = testing::TempDir() + "/truncated.off";
  std::ofstream(path) << "OFF\n4 4 0\n0 0 0\n1 0 0\n";
  truncated.meshes.push_back({"half", path});
  EXPECT_THAT(std::string(Server::Start(truncated).status().message()), HasSubstr("truncated.off"));
  const auto server = StartServer(SmallServer());
  taken.listen = "127.0.0.1:" + std::to_string(server->port());
  EXPECT_THAT(std::string(Server::Start(taken).status().message()), HasSubstr("listen = '127.0.0.1:"));
}

TEST(Server, AMessageAboutAVeryLongNameArrives) {
  const auto server = StartServer(SmallServer());
  const auto stub = v1::Models::NewStub(ChannelTo(*server));
  for (const std::string& name :
       {std::string(9000, 'n'), std::string(3000, '\n'), std::string(3 << 20, 'm')}) {
    v1::GetModelRequest get;
    get.mutable_model()->set_name(name);
    v1::Model model;
    grpc::ClientContext context;
    const grpc::Status status = stub->GetModel(&context, get, &model);
    EXPECT_EQ(status.error_code(), grpc::NOT_FOUND) << status.error_message().substr(0, 300);
    EXPECT_LE(status.error_message().size(), 2200u);
    EXPECT_THAT(status.error_message(), HasSubstr("no model is named"));
  }
}

TEST(Server, WhoAsksMayNotForgeALineOfTheLog) {
  auto server = StartServer(SmallServer());
  const auto stub = v1::Control::NewStub(ChannelTo(*server));
  v1::AcquireLeaseRequest request;
  request.set_holder("eve\n2026-11-24 10:00:00.000 info ana released the stop");
  v1::Lease lease;
  grpc::ClientContext asking, stopping;
  const grpc::Status status = stub->AcquireLease(&asking, request, &lease);
  EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_THAT(status.error_message(), HasSubstr("printable"));
  // A stop is never refused.
  v1::StopRequest stop;
  stop.set_reason("smoke\n2026-11-24 10:00:00.000 info all is well");
  v1::StopResponse stopped;
  std::ostringstream logged;
  const auto before = spdlog::default_logger();
  spdlog::set_default_logger(std::make_shared<spdlog::logger>(
      "test", std::make_shared<spdlog::sinks::ostream_sink_mt>(logged, /*force_flush=*/true)));
  EXPECT_TRUE(stub->Stop(&stopping, stop, &stopped).ok());
  server.reset();  // its threads use the logger
  spdlog::set_default_logger(before);
  const std::string text = logged.str();
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
  EXPECT_THAT(text, HasSubstr("smoke"));
}

}  // namespace
}  // namespace touchstone::service
