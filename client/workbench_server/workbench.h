// The live page: `touchstone workbench` serves it, and forwards its calls (bridge.h).
//   GET  /                 the page
//   GET  /local/state      JSON: whether there is evidence, and whom the page asks
//   GET  /local/evidence   the evidence of the command line, or with ?example that of example.h (touchstone.v1.Evidence)
//   POST /local/words      touchstone.v1.Report -> what --html puts into its page
//   POST /local/model      model_edit.h
//   POST /touchstone.v1.Service/Method   gRPC-Web
#pragma once

#include <memory>
#include <optional>
#include <string>

#include <absl/status/statusor.h>
#include <grpcpp/channel.h>

#include "client/workbench_server/http_server.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::workbench {

struct WorkbenchOptions {
  int port = 0;
  std::shared_ptr<grpc::Channel> channel;  // whom the page asks; outlives the workbench
  std::string address;                     // the same in words
  std::optional<v1::Evidence> evidence;    // with the model as text
  HttpLimits limits;
};

class Workbench {
 public:
  static absl::StatusOr<std::unique_ptr<Workbench>> Start(WorkbenchOptions options);
  int port() const { return http_->port(); }
  // With the token, which others do not know: "http://127.0.0.1:40000/#token=...".
  std::string Url() const;
  const std::string& token() const { return token_; }

 private:
  Workbench() = default;
  void Answer(const std::shared_ptr<Exchange>& exchange) const;
  absl::StatusOr<std::string> Local(const HttpRequest& request, std::string* type) const;

  WorkbenchOptions options_;
  std::string token_;
  std::string page_;
  std::unique_ptr<HttpServer> http_;  // goes first
};

}  // namespace touchstone::workbench
