// What Prometheus and probes are told, over HTTP as they ask.
#include "server/service/core/metrics.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <map>
#include <sstream>
#include <thread>

#include "server/base/test_folder.h"
#include "server/service/core/access_file.h"
#include "server/service/core/call_log.h"
#include "server/service/rpc/server.h"
#include "server/service/tests/test_call.h"
#include "touchstone/v1/diagnosis.grpc.pb.h"
#include "touchstone/v1/source.grpc.pb.h"

namespace touchstone::service {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

// The whole answer to one request.
std::string Ask(int port, const std::string& request) {
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  std::string answer;
  if (::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0) {
    ::send(fd, request.data(), request.size(), MSG_NOSIGNAL);
    ::shutdown(fd, SHUT_WR);
    char piece[4096];
    for (ssize_t got; (got = ::recv(fd, piece, sizeof piece, 0)) > 0;) answer.append(piece, got);
  }
  ::close(fd);
  return answer;
}

std::string Get(int port, const std::string& path) {
  return Ask(port, "GET " + path + " HTTP/1.1\r\nHost: test\r\n\r\n");
}

class MetricsTest : public testing::Test {
 protected:
  void Start() {
    options_.listen = "127.0.0.1:0";
    options_.metrics = ":0";
    options_.supershape_triangles = 500;
    options_.threads = 1;
    server_ = Server::Start(options_).value();
    channel_ = grpc::CreateChannel("127.0.0.1:" + std::to_string(server_->port()),
                                   grpc::InsecureChannelCredentials());
  }
  std::string Metrics() { return Get(server_->metrics_port(), "/metrics"); }
  // A call is counted when its server is done with it, which may be after its client is.
  void ExpectSoon(const testing::Matcher<std::string>& matcher) {
    std::string page = Metrics();
    for (int k = 0; k < 10'000 && !testing::Matches(matcher)(page); ++k) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      page = Metrics();
    }
    EXPECT_THAT(page, matcher);
  }

  const TestFolder folder_;
  ServerOptions options_;
  std::unique_ptr<Server> server_;
  std::shared_ptr<grpc::Channel> channel_;
};

TEST_F(MetricsTest, CountsCallsByMethodAndStatusAndSamples) {
  Start();
  EXPECT_THAT(Metrics(), AllOf(HasSubstr("HTTP/1.1 200 OK"), HasSubstr("\ntouchstone_samples_total 0\n"),
                               HasSubstr("touchstone_last_comparison_rmse_us Nan")));
  for (int k = 0; k < 3; ++k) EXPECT_TRUE(CallAny(channel_, "/touchstone.v1.Source/Describe", "").ok());
  EXPECT_EQ(CallAny(channel_, "/touchstone.v1.Models/CreateModel", "").error_code(), grpc::INVALID_ARGUMENT);
  v1::StreamDatasetRequest request;
  request.mutable_spec()->add_objects("lat00");
  request.mutable_spec()->set_samples(100);
  request.mutable_spec()->mutable_plan()->mutable_sphere();
  grpc::ClientContext context;
  v1::StreamDatasetResponse response;
  const auto reader = v1::Source::NewStub(channel_)->StreamDataset(&context, request);
  while (reader->Read(&response)) {
  }
  const grpc::Status streamed = reader->Finish();
  EXPECT_TRUE(streamed.ok()) << streamed.error_message();
  ExpectSoon(AllOf(
      HasSubstr(
          R"(handled_total{grpc_code="OK",grpc_method="StreamDataset",grpc_service="touchstone.v1.Source"} 1)"),
      HasSubstr(R"(started_total{grpc_method="Describe",grpc_service="touchstone.v1.Source"} 3)"),
      HasSubstr(
          R"(handled_total{grpc_code="OK",grpc_method="Describe",grpc_service="touchstone.v1.Source"} 3)"),
      HasSubstr(
          R"(grpc_code="INVALID_ARGUMENT",grpc_method="CreateModel",grpc_service="touchstone.v1.Models"} 1)"),
      HasSubstr(R"(handling_seconds_count{grpc_method="Describe",grpc_service="touchstone.v1.Source"} 3)"),
      HasSubstr("\ntouchstone_samples_total 100\n"), HasSubstr("\ntouchstone_touches_total 100\n"),
      HasSubstr("\ntouchstone_streams_active 0\n")));
}

TEST_F(MetricsTest, EveryLineIsOfTheFormatThatPrometheusReads) {
  Start();
  CallAny(channel_, "/touchstone.v1.Source/Describe", "");
  const std::string answer = Metrics();
  std::istringstream lines(answer.substr(answer.find("\r\n\r\n") + 4));
  std::map<std::string, std::string> types;
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind("# TYPE ", 0) == 0) {
      const size_t space = line.find(' ', 7);
      EXPECT_TRUE(types.emplace(line.substr(7, space - 7), line.substr(space + 1)).second) << line;
    } else if (line[0] != '#') {
      EXPECT_THAT(line, testing::MatchesRegex("[a-z_]+(\\{[^{}]*\\})? [0-9NIanf+.e-]+"));
      std::string name = line.substr(0, line.find_first_of("{ "));
      for (const std::string end : {"_bucket", "_sum", "_count"})
        if (name.size() > end.size() && types.count(name.substr(0, name.size() - end.size())) > 0 &&
            name.compare(name.size() - end.size(), end.size(), end) == 0)
          name.resize(name.size() - end.size());
      EXPECT_EQ(types.count(name), 1u) << line;
    }
  }
}

TEST_F(MetricsTest, CountsWhoIsRefusedAndMakesNoSeriesOfInventedMethods) {
  const std::string token = NewAccessToken();
  std::ofstream(folder_.Path("tokens")) << "ana reader " << HashOfToken(token) << "\n";
  options_.access.token_file = folder_.Path("tokens");
  Start();
  CallAny(channel_, "/touchstone.v1.Source/Describe", "");
  CallAny(channel_, "/touchstone.v1.Models/CreateModel", token);
  CallAny(channel_, "/touchstone.v1.Source/Invented", "");
  ExpectSoon(AllOf(
      HasSubstr(
          R"(grpc_code="UNAUTHENTICATED",grpc_method="Describe",grpc_service="touchstone.v1.Source"} 1)"),
      HasSubstr(
          R"(grpc_code="PERMISSION_DENIED",grpc_method="CreateModel",grpc_service="touchstone.v1.Models"} 1)"),
      HasSubstr(R"(grpc_code="UNAUTHENTICATED",grpc_method="other",grpc_service="other"} 1)"),
      Not(HasSubstr("Invented")), Not(HasSubstr(token))));
}

TEST_F(MetricsTest, ACallCarriesItsIdBack) {
  Start();
  const auto stub = v1::Source::NewStub(channel_);
  const auto id_of = [&](const std::string& given) {
    grpc::ClientContext context;
    if (!given.empty()) context.AddMetadata("x-request-id", given);
    v1::DescribeResponse response;
    EXPECT_TRUE(stub->Describe(&context, {}, &response).ok());
    const auto id = context.GetServerInitialMetadata().find("x-request-id");
    return id == context.GetServerInitialMetadata().end() ? ""
                                                          : std::string(id->second.data(), id->second.size());
  };
  EXPECT_EQ(id_of("job-7.a"), "job-7.a");
  EXPECT_THAT(id_of(""), testing::MatchesRegex("[0-9a-f]{16}"));
  EXPECT_THAT(id_of("no such id"), testing::MatchesRegex("[0-9a-f]{16}"));
  EXPECT_EQ(id_of(std::string(256, 'x')).size(), 256u);
  EXPECT_EQ(id_of(std::string(257, 'x')).size(), 16u);
}

TEST(CallLog, TakesTheTraceOfATraceParentAndOfNothingElse) {
  const std::string id = "4bf92f3577b34da6a3ce929d0e0e4736", parent = "-00f067aa0ba902b7-01";
  EXPECT_EQ(TraceIdOf("00-" + id + parent), id);
  EXPECT_EQ(TraceIdOf("01-" + id + parent + "-more"), id);
  for (const std::string& wrong :
       {std::string(), id, "00-" + id + parent + "-more", "ff-" + id + parent, "00_" + id + parent,
        "00-" + std::string(32, '0') + parent, "00-4BF92F3577B34DA6A3CE929D0E0E4736" + parent,
        "00-" + id + "-0000000000000000-01", "00-" + id.substr(1) + parent + "0"})
    EXPECT_EQ(TraceIdOf(wrong), "") << wrong;
}

TEST_F(MetricsTest, ReadinessEndsWithDrainingAndLivenessDoesNot) {
  Start();
  const int port = server_->metrics_port();
  EXPECT_THAT(Get(port, "/livez"), HasSubstr("200 OK"));
  EXPECT_THAT(Get(port, "/readyz?verbose"), HasSubstr("200 OK"));
  EXPECT_THAT(Get(port, "/etc/passwd"), HasSubstr("404"));
  EXPECT_THAT(Ask(port, "POST /metrics HTTP/1.1\r\n\r\n"), HasSubstr("405"));
  EXPECT_EQ(Ask(port, "GET /" + std::string(20000, 'a')), "");
  EXPECT_EQ(Ask(port, "GET"), "");
  server_->Drain();
  EXPECT_THAT(Get(port, "/readyz"), AllOf(HasSubstr("503"), HasSubstr("draining")));
  EXPECT_THAT(Get(port, "/livez"), HasSubstr("200 OK"));
}

TEST(StatusPages, AnAddressThatCannotBeServedIsNamed) {
  ServerOptions options;
  options.listen = "127.0.0.1:0";
  options.supershape_triangles = 500;
  options.threads = 1;
  for (const char* wrong : {"9464", "127.0.0.1:x", "127.0.0.1:70000", "no.such.host.invalid:1"}) {
    options.metrics = wrong;
    EXPECT_THAT(std::string(Server::Start(options).status().message()),
                HasSubstr("metrics = '" + std::string(wrong)));
  }
}

}  // namespace
}  // namespace touchstone::service
