// Connections that say nothing, and more of them than a server has files for, or an address may have.
#include <absl/strings/str_cat.h>
#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <grpcpp/grpcpp.h>

#include "touchstone/v1/control.grpc.pb.h"
#include "touchstone/v1/source.grpc.pb.h"

namespace touchstone {
namespace {

// The real program, with so many files.
class ServerProcess {
 public:
  ServerProcess(int files, const std::string& flags) {
    const std::string program =
        (std::filesystem::read_symlink("/proc/self/exe").parent_path() / "touchstone-server").string();
    const std::string command =
        absl::StrCat("ulimit -n ", files, "; exec ", program,
                     " --listen 127.0.0.1:0 --supershape-triangles 200 --threads 1 --log-level off ", flags);
    int output[2];
    if (::pipe2(output, O_CLOEXEC) != 0) return;
    process_ = ::fork();
    if (process_ == 0) {
      ::dup2(output[1], STDOUT_FILENO);
      ::execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
      ::_exit(127);
    }
    ::close(output[1]);
    FILE* lines = ::fdopen(output[0], "r");
    if (std::fscanf(lines, "listening on 127.0.0.1:%d", &port_) != 1) port_ = 0;
    std::fclose(lines);
  }
  ~ServerProcess() {
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
  }
  int port() const { return port_; }

 private:
  pid_t process_ = -1;
  int port_ = 0;
};

// Sockets that are open and say nothing.
class SilentConnections {
 public:
  explicit SilentConnections(int port) : port_(port) {}
  ~SilentConnections() {
    for (const int file : files_) ::close(file);
  }
  void Open(int count) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<uint16_t>(port_));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    for (int k = 0; k < count; ++k) {
      const int file = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
      ASSERT_GE(file, 0);
      files_.push_back(file);
      ASSERT_EQ(::connect(file, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    }
  }
  // Waits until the server closes it.
  bool IsClosed(int number) const {
    char byte;
    return ::recv(files_[number], &byte, 1, 0) <= 0;
  }

 private:
  const int port_;
  std::vector<int> files_;
};

std::shared_ptr<grpc::Channel> NewChannel(int port) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 50);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 200);
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  return grpc::CreateCustomChannel(absl::StrCat("127.0.0.1:", port), grpc::InsecureChannelCredentials(),
                                   arguments);
}

grpc::Status Describe(const std::shared_ptr<grpc::Channel>& channel) {
  grpc::ClientContext context;
  context.set_wait_for_ready(true);
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  v1::DescribeResponse description;
  return v1::Source::NewStub(channel)->Describe(&context, {}, &description);
}

grpc::Status Describe(int port) {
  return Describe(NewChannel(port));
}

// A dataset that is being read, until it goes.
class RunningStream {
 public:
  explicit RunningStream(const std::shared_ptr<grpc::Channel>& channel)
      : stub_(v1::Source::NewStub(channel)) {
    v1::StreamDatasetRequest request;
    request.mutable_spec()->add_objects("lat20");
    request.mutable_spec()->mutable_plan()->mutable_sphere();
    request.mutable_spec()->set_samples(1'000'000'000);
    reader_ = stub_->StreamDataset(&context_, request);
    v1::StreamDatasetResponse response;
    EXPECT_TRUE(reader_->Read(&response));
  }
  ~RunningStream() {
    context_.TryCancel();
    (void)reader_->Finish();
  }

 private:
  const std::unique_ptr<v1::Source::Stub> stub_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::StreamDatasetResponse>> reader_;
};

TEST(Connections, ThatSayNothingDoNotMakeAServerUnreachable) {
  const ServerProcess server(128, "--handshake-s 0.3 --max-connections-per-address 100000");
  ASSERT_NE(server.port(), 0);
  SilentConnections silent(server.port());
  silent.Open(400);
  const grpc::Status status = Describe(server.port());
  EXPECT_TRUE(status.ok()) << status.error_message();
  silent.Open(400);
  EXPECT_TRUE(Describe(server.port()).ok()) << "again";
}

TEST(Connections, ThatSayNothingGiveWayToNewerOnesOfTheirAddress) {
  const ServerProcess server(1024, "--max-connections-per-address 3 --handshake-s 600");
  ASSERT_NE(server.port(), 0);
  SilentConnections silent(server.port());
  silent.Open(10);
  for (int k = 0; k < 7; ++k) EXPECT_TRUE(silent.IsClosed(k)) << k;
  EXPECT_TRUE(Describe(server.port()).ok());
}

TEST(Connections, ThatAreIdleDoNotShutTheirAddressOut) {
  const ServerProcess server(1024, "--max-connections-per-address 3");
  ASSERT_NE(server.port(), 0);
  std::vector<std::shared_ptr<grpc::Channel>> idle;
  for (int k = 0; k < 10; ++k) {
    idle.push_back(NewChannel(server.port()));
    EXPECT_TRUE(Describe(idle.back()).ok()) << k;
  }
  // Those that were closed come back when they have a call.
  for (const auto& channel : idle) EXPECT_TRUE(Describe(channel).ok());
}

TEST(Connections, WithCallsLeaveRoomForAStop) {
  const ServerProcess server(1024, "--max-connections-per-address 2");
  ASSERT_NE(server.port(), 0);
  std::vector<std::unique_ptr<RunningStream>> streams;
  for (int k = 0; k < 2; ++k) streams.push_back(std::make_unique<RunningStream>(NewChannel(server.port())));
  const auto call = [&](auto method, auto request, auto response) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    const auto stub = v1::Control::NewStub(NewChannel(server.port()));
    return (stub.get()->*method)(&context, request, &response);
  };
  const grpc::Status state = call(&v1::Control::Stub::GetState, v1::GetStateRequest(), v1::State());
  EXPECT_EQ(state.error_code(), grpc::UNAVAILABLE);
  for (int k = 0; k < 20; ++k) {
    const grpc::Status stop = call(&v1::Control::Stub::Stop, v1::StopRequest(), v1::StopResponse());
    EXPECT_TRUE(stop.ok()) << stop.error_message();
  }
}

}  // namespace
}  // namespace touchstone
