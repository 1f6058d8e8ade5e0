// The live page: `touchstone workbench` serves it, and forwards its calls (bridge.h).
//   GET  /                 the page
//   GET  /local/state      JSON: whether there is evidence, and whom the page asks
//   GET  /local/evidence   the evidence of the command line, or with ?example that of example.h (touchstone.v1.Evidence)
//   POST /local/send-ahead sends the evidence's measurements again, where they went ahead as a session that the server lacks
//   POST /local/words      touchstone.v1.Report -> what --html puts into its page
//   POST /local/model      model_edit.h
//   GET  /local/formula    JSON: what a formula may use; POST: the names in an expression, model_edit.h
//   GET  /local/watch, POST /local/rig, POST /local/stop   the rig of --rig, rig_desk.h
//   GET  /local/evidence?rig, /local/rig/set.csv           what its run has measured so far
//   GET  /local/rig/drawing                                what its dry run would touch, touch_drawing.h
//   POST /touchstone.v1.Service/Method   gRPC-Web
// A second port answers POST /local/stop alone, with {"token", ...} as text: browsers open six connections to a port, and a stop
// waits for none of them.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include <absl/status/statusor.h>
#include "client/workbench_server/http/http_server.h"
#include "client/workbench_server/http/upstream.h"
#include "client/workbench_server/rig/rig_desk.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::workbench {

struct WorkbenchOptions {
  int port = 0;
  client::Connection* connection =
      nullptr;                              // whom the page asks; outlives the workbench, which uses it alone
  std::unique_ptr<client::Connection> rig;  // a gateway's; null: the page has no rig
  std::function<void(const std::string&)> log = [](const std::string&) {
  };                                     // of the rig's stops and losses, for people
  std::optional<v1::Evidence> evidence;  // with the model as text
  // Sends to this server the session that `evidence` names, which it does not have any more; called from several threads.
  // Unset: the evidence is whole.
  std::function<absl::Status(const std::shared_ptr<grpc::Channel>& server)> send_ahead_again;
  HttpLimits limits;
};

class Workbench {
 public:
  static absl::StatusOr<std::unique_ptr<Workbench>> Start(WorkbenchOptions options);
  ~Workbench();  // stops a rig that moves because of it
  int port() const { return http_->port(); }
  int stop_port() const { return stop_http_ ? stop_http_->port() : 0; }  // 0: there is no rig
  // With the token, which others do not know: "http://127.0.0.1:40000/#token=...".
  std::string Url() const;
  const std::string& token() const { return token_; }

 private:
  Workbench() = default;
  absl::Status Listen();
  void Answer(const std::shared_ptr<Exchange>& exchange) const;
  void AnswerStop(const std::shared_ptr<Exchange>& exchange) const;
  absl::StatusOr<std::string> Local(const HttpRequest& request, std::string* type) const;
  absl::StatusOr<std::string> OfRig(const HttpRequest& request, std::string* type) const;

  WorkbenchOptions options_;
  std::string token_;
  std::string page_;
  std::shared_ptr<Upstream> upstream_;
  std::unique_ptr<RigDesk> desk_;
  std::unique_ptr<HttpServer> stop_http_, http_;  // go first
};

}  // namespace touchstone::workbench
