// Over a real socket, with the real server in this process behind it.
#include "client/workbench_server/workbench.h"

#include <absl/strings/str_cat.h>
#include <gtest/gtest.h>

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>

#include "client/source/connection/connection.h"
#include "client/workbench/page.h"
#include "client/workbench_server/example.h"
#include "client/workbench_server/http/grpc_web.h"
#include "server/base/test_paths.h"
#include "server/base/text/text.h"
#include "server/service/rpc/server.h"

namespace touchstone::workbench {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;

class WorkbenchTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!PageTemplate().ok()) GTEST_SKIP() << PageTemplate().status();
    connection_ = *client::Connection::Open({});
    Serve({});
  }

  void Serve(HttpLimits limits) {
    WorkbenchOptions options;
    options.connection = connection_.get();
    options.limits = limits;
    workbench_ = *Workbench::Start(std::move(options));
    host_ = "127.0.0.1:" + std::to_string(workbench_->port());
  }

  tcp::socket Connect() {
    tcp::socket socket(io_);
    socket.connect({asio::ip::address_v4::loopback(), static_cast<uint16_t>(workbench_->port())});
    return socket;
  }

  // All of the answer to what is sent.
  std::string Ask(const std::string& text) {
    tcp::socket socket = Connect();
    boost::system::error_code error;
    asio::write(socket, asio::buffer(text), error);
    std::string answer;
    asio::read(socket, asio::dynamic_buffer(answer), error);
    return answer;
  }

  std::string Head(const std::string& first, const std::string& host, const std::string& fields,
                   size_t length) {
    return first + " HTTP/1.1\r\nHost: " + host + "\r\nx-touchstone-token: " + workbench_->token() + "\r\n" +
           fields + "Content-Length: " + std::to_string(length) + "\r\n\r\n";
  }
  std::string Call(const std::string& method, const std::string& body, const std::string& fields = "") {
    return Ask(Head("POST /touchstone.v1." + method, host_,
                    "Content-Type: application/grpc-web+proto\r\n" + fields, body.size()) +
               body);
  }

  asio::io_context io_;
  std::unique_ptr<client::Connection> connection_;
  std::unique_ptr<Workbench> workbench_;
  std::string host_;
};

bool Has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST_F(WorkbenchTest, ForwardsAUnaryCall) {
  const std::string answer = Call("Models/ListEffects", MessageFrame(""));
  EXPECT_TRUE(Has(answer, "HTTP/1.1 200")) << answer.substr(0, 300);
  EXPECT_TRUE(Has(answer, "Content-Type: application/grpc-web+proto")) << answer.substr(0, 300);
  EXPECT_TRUE(Has(answer, "tip_radius"));
  EXPECT_TRUE(Has(answer, "grpc-status: 0\r\n"));
}

TEST_F(WorkbenchTest, ForwardsAStreamToItsReport) {
  v1::CompareRequest request;
  *request.mutable_evidence() = *ExampleEvidence();
  const std::string answer = Call("Diagnosis/Compare", MessageFrame(request.SerializeAsString()));
  EXPECT_TRUE(Has(answer, "lat20"));
  EXPECT_TRUE(Has(answer, "grpc-status: 0\r\n")) << answer.substr(0, 600);
}

TEST_F(WorkbenchTest, PassesOnAnErrorAndRefusesWhatIsNoCall) {
  v1::GetModelRequest request;
  request.mutable_model()->set_name("no_such_model");
  EXPECT_TRUE(Has(Call("Models/GetModel", MessageFrame(request.SerializeAsString())), "grpc-status: 5\r\n"));
  EXPECT_TRUE(
      Has(Call("Models/ListEffects", MessageFrame(""), "grpc-timeout: soon\r\n"), "grpc-status: 3\r\n"));
  EXPECT_TRUE(Has(Call("Models/ListEffects", "\x01"), "grpc-status: 3\r\n"));
}

TEST_F(WorkbenchTest, RefusesMethodsThatMoveOrKeep) {
  for (const char* method : {"Control/AcquireLease", "Rig/Home", "Source/Touch"}) {
    const std::string answer = Call(method, MessageFrame(""));
    EXPECT_TRUE(Has(answer, "grpc-status: 7\r\n") && Has(answer, "needs the role operator")) << answer;
  }
}

TEST_F(WorkbenchTest, RefusesOtherHostsOriginsAndTokens) {
  EXPECT_TRUE(
      Has(Ask(Head("GET /", "evil.example:" + std::to_string(workbench_->port()), "", 0)), "HTTP/1.1 403"));
  EXPECT_TRUE(Has(Ask(Head("GET /", "127.0.0.1.evil.example", "", 0)), "HTTP/1.1 403"));
  EXPECT_TRUE(
      Has(Ask(Head("GET /local/state", host_, "Origin: http://evil.example\r\n", 0)), "HTTP/1.1 403"));
  EXPECT_TRUE(Has(Ask(Head("GET /local/state", host_, "Origin: http://127.0.0.1:1\r\n", 0)), "HTTP/1.1 403"));
  EXPECT_TRUE(Has(Ask(Head("GET /local/state", host_, "Sec-Fetch-Site: cross-site\r\n", 0)), "HTTP/1.1 403"));
  EXPECT_TRUE(Has(Ask("GET /local/state HTTP/1.1\r\nHost: " + host_ + "\r\n\r\n"), "HTTP/1.1 401"));
  EXPECT_TRUE(Has(Ask("GET / HTTP/1.1\r\nHost: " + host_ + "\r\n\r\n"), "HTTP/1.1 200"));
  EXPECT_TRUE(
      Has(Ask(Head("GET /local/state", host_, "Origin: http://" + host_ + "\r\n", 0)), "HTTP/1.1 200"));
  EXPECT_TRUE(Has(Ask(Head("GET /etc/passwd", host_, "", 0)), "HTTP/1.1 404"));
}

// A file of this user leads the browser there; nothing else of another site does.
TEST_F(WorkbenchTest, IsOpenedFromElsewhereAsAPageAlone) {
  const std::string elsewhere = "Sec-Fetch-Site: cross-site\r\n";
  const std::string opened = elsewhere + "Sec-Fetch-Mode: navigate\r\nSec-Fetch-Dest: document\r\n";
  EXPECT_TRUE(Has(Ask(Head("GET /", host_, opened, 0)), "HTTP/1.1 200"));
  EXPECT_TRUE(Has(Ask(Head("GET /", host_, elsewhere, 0)), "HTTP/1.1 403"));
  EXPECT_TRUE(Has(Ask(Head("GET /local/state", host_, opened, 0)), "HTTP/1.1 403"));
}

TEST_F(WorkbenchTest, WithoutARigSaysHowToGetOne) {
  for (const char* path : {"POST /local/rig", "POST /local/stop", "GET /local/watch"}) {
    const std::string answer = Ask(Head(path, host_, "", 0));
    EXPECT_TRUE(Has(answer, "HTTP/1.1 400") && Has(answer, "--rig")) << answer;
  }
  EXPECT_EQ(workbench_->stop_port(), 0);
}

TEST_F(WorkbenchTest, TakesOnlyAGatewayForARig) {
  service::ServerOptions served;
  served.listen = "127.0.0.1:0";
  const auto server = *service::Server::Start(std::move(served));
  client::ConnectionOptions asked;
  asked.servers = {absl::StrCat("127.0.0.1:", server->port())};
  WorkbenchOptions options;
  options.connection = connection_.get();
  options.rig = *client::Connection::Open(std::move(asked));
  const auto refused = Workbench::Start(std::move(options));
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_TRUE(Has(std::string(refused.status().message()), "a touchstone-gateway was expected"));
}

TEST_F(WorkbenchTest, AsksTheNextServerWhereOneIsLost) {
  std::vector<std::unique_ptr<service::Server>> servers;
  client::ConnectionOptions asked;
  for (int k = 0; k < 2; ++k) {
    service::ServerOptions served;
    served.listen = "127.0.0.1:0";
    servers.push_back(*service::Server::Start(std::move(served)));
    asked.servers.push_back(absl::StrCat("127.0.0.1:", servers.back()->port()));
  }
  const std::vector<std::string> addresses = asked.servers;
  workbench_.reset();
  connection_ = *client::Connection::Open(std::move(asked));
  Serve({});
  const std::string header = "x-touchstone-server: ";
  EXPECT_TRUE(Has(Call("Models/ListEffects", MessageFrame("")), header + addresses[0]));
  servers[0].reset();
  const std::string answer = Call("Models/ListEffects", MessageFrame(""));
  EXPECT_TRUE(Has(answer, header + addresses[1]) && Has(answer, "grpc-status: 0\r\n"))
      << answer.substr(0, 300);
  servers[1].reset();
  EXPECT_TRUE(Has(Call("Models/ListEffects", MessageFrame("")), "grpc-status: 14\r\n"));
}

TEST_F(WorkbenchTest, RefusesWhatIsTooLarge) {
  HttpLimits limits;
  limits.body_bytes = 1000;
  limits.head_bytes = 2000;
  Serve(limits);
  EXPECT_TRUE(Has(Ask(Head("POST /local/model", host_, "", 2000) + std::string(2000, 'x')), "HTTP/1.1 413"));
  EXPECT_TRUE(Has(Ask("GET / HTTP/1.1\r\nHost: " + host_ + "\r\nX: " + std::string(5000, 'x') + "\r\n\r\n"),
                  "HTTP/1.1 413"));
}

TEST_F(WorkbenchTest, RefusesMoreConnectionsThanItMayHave) {
  HttpLimits limits;
  limits.connections = 1;
  Serve(limits);
  const tcp::socket first = Connect();
  // A refusal comes without a request, so that its arrival says that the first connection was counted.
  tcp::socket second = Connect();
  std::string answer;
  boost::system::error_code error;
  asio::read(second, asio::dynamic_buffer(answer), error);
  EXPECT_TRUE(Has(answer, "HTTP/1.1 503")) << answer;
}

TEST_F(WorkbenchTest, SurvivesRequestsThatAreCutAndClientsThatLeave) {
  v1::DiagnoseRequest request;
  *request.mutable_evidence() = *ExampleEvidence();
  const std::string body = MessageFrame(request.SerializeAsString());
  const std::string head = Head("POST /touchstone.v1.Diagnosis/Diagnose", host_,
                                "Content-Type: application/grpc-web+proto\r\n", body.size());
  {
    tcp::socket cut = Connect();
    asio::write(cut, asio::buffer(head + body.substr(0, 1000)));
  }
  {
    // Gone after its first piece: the call is cancelled.
    tcp::socket gone = Connect();
    asio::write(gone, asio::buffer(head + body));
    char byte;
    asio::read(gone, asio::buffer(&byte, 1));
  }
  EXPECT_TRUE(Has(Call("Models/ListEffects", MessageFrame("")), "grpc-status: 0\r\n"));
}

TEST(HttpLimits, AreThoseThatAreDocumented) {
  const std::string page = ReadFile(SourceDir() + "/server/LIMITS.md").value_or("");
  const HttpLimits limits;
  const auto row = [](const char* name, double value, const char* unit) {
    return absl::StrCat("| `", name, "` | ", value, unit, " |");
  };
  for (const std::string& line :
       {row("connections", limits.connections, ""), row("head_bytes", limits.head_bytes >> 10, " KiB"),
        row("body_bytes", static_cast<double>(limits.body_bytes >> 20), " MiB"),
        row("head_s", limits.head_s, " s"), row("stall_s", limits.stall_s, " s")})
    EXPECT_TRUE(Has(page, line)) << line;
}

TEST_F(WorkbenchTest, EndsACallAtItsDeadline) {
  v1::DiagnoseRequest request;
  *request.mutable_evidence() = *ExampleEvidence();
  EXPECT_TRUE(
      Has(Call("Diagnosis/Diagnose", MessageFrame(request.SerializeAsString()), "grpc-timeout: 10m\r\n"),
          "grpc-status: 4\r\n"));
}

TEST_F(WorkbenchTest, EndsWhileACallRuns) {
  v1::DiagnoseRequest request;
  *request.mutable_evidence() = *ExampleEvidence();
  const std::string body = MessageFrame(request.SerializeAsString());
  tcp::socket socket = Connect();
  asio::write(socket, asio::buffer(Head("POST /touchstone.v1.Diagnosis/Diagnose", host_,
                                        "Content-Type: application/grpc-web+proto\r\n", body.size()) +
                                   body));
  char byte;
  asio::read(socket, asio::buffer(&byte, 1));
  workbench_.reset();
  boost::system::error_code error;
  std::string rest;
  asio::read(socket, asio::dynamic_buffer(rest), error);
  EXPECT_FALSE(Has(rest, "grpc-status: 0"));
}

}  // namespace
}  // namespace touchstone::workbench
