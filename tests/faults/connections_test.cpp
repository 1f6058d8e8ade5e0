// Connections that say nothing, and more of them than a server has files for.
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
#include <string>
#include <vector>

#include <grpcpp/grpcpp.h>

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
  // How many the server greeted; it closed the others.
  int Greeted() const {
    int greeted = 0;
    char byte;
    for (const int file : files_) greeted += ::recv(file, &byte, 1, 0) == 1 ? 1 : 0;
    return greeted;
  }

 private:
  const int port_;
  std::vector<int> files_;
};

grpc::Status Describe(int port) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 50);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 200);
  const auto stub = v1::Source::NewStub(grpc::CreateCustomChannel(
      absl::StrCat("127.0.0.1:", port), grpc::InsecureChannelCredentials(), arguments));
  grpc::ClientContext context;
  context.set_wait_for_ready(true);
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  v1::DescribeResponse description;
  return stub->Describe(&context, {}, &description);
}

TEST(Connections, ThatSayNothingDoNotMakeAServerDeaf) {
  const ServerProcess server(128, "--handshake-s 0.3 --max-connections-per-address 100000");
  ASSERT_NE(server.port(), 0);
  SilentConnections silent(server.port());
  silent.Open(400);
  const grpc::Status status = Describe(server.port());
  EXPECT_TRUE(status.ok()) << status.error_message();
  silent.Open(400);
  EXPECT_TRUE(Describe(server.port()).ok()) << "again";
}

TEST(Connections, OfOneAddressAreLimited) {
  const ServerProcess server(1024, "--max-connections-per-address 3");
  ASSERT_NE(server.port(), 0);
  SilentConnections silent(server.port());
  silent.Open(10);
  EXPECT_EQ(silent.Greeted(), 3);
}

}  // namespace
}  // namespace touchstone
