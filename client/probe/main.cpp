// touchstone-probe: asks a server's standard health check, for containers and units that have no other client. It asks the
// server itself and never a proxy.
// Exit codes: 0 serving, 2 usage or bad input, 3 unreachable, 4 not serving.
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>

#include "grpc/health/v1/health.grpc.pb.h"
#include "server/base/process/out_of_memory.h"
#include "server/base/text/text.h"
#include "server/service/channel/channel.h"
#include "server/service/options/help_layout.h"
#include "server/service/options/man_page.h"

namespace {

struct ProbeOptions {
  std::string address = "127.0.0.1:50051";
  std::string ca, certificate, key;  // PEM files
  std::string server_name;           // that the certificate must carry
  double timeout_s = 3;
};

int Fail(int code, const std::string& text) {
  std::fprintf(stderr, "touchstone-probe: %s\n", text.c_str());
  return code;
}

absl::Status ReadInto(const std::string& path, std::string* text) {
  if (path.empty()) return absl::OkStatus();
  absl::StatusOr<std::string> read = touchstone::ReadFile(path);
  if (read.ok()) *text = *std::move(read);
  return read.status();
}

int Probe(const ProbeOptions& options) {
  std::shared_ptr<grpc::ChannelCredentials> credentials = grpc::InsecureChannelCredentials();
  grpc::ChannelArguments arguments;
  if (!options.ca.empty()) {
    grpc::SslCredentialsOptions tls;
    for (const absl::Status& read :
         {ReadInto(options.ca, &tls.pem_root_certs), ReadInto(options.certificate, &tls.pem_cert_chain),
          ReadInto(options.key, &tls.pem_private_key)})
      if (!read.ok()) return Fail(2, std::string(read.message()));
    credentials = grpc::SslCredentials(tls);
    if (!options.server_name.empty()) arguments.SetSslTargetNameOverride(options.server_name);
  }
  const auto channel = touchstone::service::OpenChannel(options.address, credentials, arguments, {},
                                                        touchstone::service::ProxyUse::kNever);
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() +
                       std::chrono::milliseconds(static_cast<int64_t>(options.timeout_s * 1000)));
  grpc::health::v1::HealthCheckResponse response;
  const grpc::Status status = grpc::health::v1::Health::NewStub(channel)->Check(&context, {}, &response);
  if (!status.ok()) return Fail(3, options.address + " does not answer: " + status.error_message());
  if (response.status() != grpc::health::v1::HealthCheckResponse::SERVING)
    return Fail(4, options.address + " answers, but is not serving: it starts or drains");
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  ProbeOptions options;
  CLI::App app{
      "Asks a server's or gateway's standard gRPC health check, never through a proxy. Exit codes: 0 "
      "serving, "
      "2 usage or bad input,\n"
      "3 unreachable, 4 not serving.",
      "touchstone-probe"};
  app.add_option("ADDRESS", options.address, "HOST:PORT. Default: 127.0.0.1:50051");
  CLI::Option* ca = app.add_option("--ca", options.ca, "CA of the server's certificate (PEM): asks over TLS");
  CLI::Option* key = app.add_option("--key", options.key, "Private key of --cert (PEM)");
  app.add_option("--cert", options.certificate, "Certificate of this client (PEM)")->needs(ca)->needs(key);
  app.add_option("--server-name", options.server_name, "Name in the server's certificate, if not its address")
      ->needs(ca);
  app.add_option("--timeout-s", options.timeout_s, "Seconds to wait. Default: 3")
      ->check(CLI::Range(0.1, 60.0));
  if (touchstone::service::PrintedManPage(app, argc, argv)) return 0;
  app.formatter(std::make_shared<touchstone::service::HelpLayout>());
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return touchstone::RunWithinMemory("touchstone-probe", 3, [&] { return Probe(options); });
}
