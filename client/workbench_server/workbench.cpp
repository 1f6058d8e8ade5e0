#include "client/workbench_server/workbench.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include <boost/beast/http/field.hpp>
#include <boost/beast/http/verb.hpp>

#include "client/report/report.h"
#include "client/workbench/page.h"
#include "client/workbench_server/example.h"
#include "client/workbench_server/formula_words.h"
#include "client/workbench_server/http/bridge.h"
#include "client/workbench_server/http/request_guard.h"
#include "client/workbench_server/model_edit.h"
#include "server/base/status.h"

namespace touchstone::workbench {
namespace {

namespace http = boost::beast::http;
constexpr char kJson[] = "application/json";
constexpr char kBytes[] = "application/octet-stream";

}  // namespace

absl::StatusOr<std::unique_ptr<Workbench>> Workbench::Start(WorkbenchOptions options) {
  std::unique_ptr<Workbench> workbench(new Workbench);
  TOUCHSTONE_RETURN_IF_ERROR(PageTemplate().status());
  workbench->token_ = NewToken();
  workbench->upstream_ = std::make_shared<Upstream>(options.connection);
  if (options.rig != nullptr) {
    TOUCHSTONE_ASSIGN_OR_RETURN(workbench->desk_, RigDesk::Open(std::move(options.rig), options.log));
  }
  workbench->options_ = std::move(options);
  TOUCHSTONE_RETURN_IF_ERROR(workbench->Listen());
  return workbench;
}

absl::Status Workbench::Listen() {
  HttpOptions served;
  served.limits = options_.limits;
  if (desk_ != nullptr) {
    HttpOptions stop = served;
    stop.beside_page = true;
    stop.open_path.clear();
    stop.limits.body_bytes = stop.limits.head_bytes;
    TOUCHSTONE_ASSIGN_OR_RETURN(stop_http_, HttpServer::Start(std::move(stop), [this](const auto& exchange) {
                                  AnswerStop(exchange);
                                }));
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(page_, FilledPage("{\"live\":true}", PageReach::kOwnOrigin, stop_port()));
  served.port = options_.port;
  served.token = token_;
  TOUCHSTONE_ASSIGN_OR_RETURN(
      http_, HttpServer::Start(std::move(served), [this](const auto& exchange) { Answer(exchange); }));
  return absl::OkStatus();
}

Workbench::~Workbench() {
  stop_http_.reset();
  http_.reset();
  desk_.reset();
  if (upstream_ != nullptr) upstream_->End();
}

std::string Workbench::Url() const {
  return absl::StrCat("http://127.0.0.1:", port(), "/#token=", token_);
}

void Workbench::Answer(const std::shared_ptr<Exchange>& exchange) const {
  if (IsGrpcWeb(exchange->request())) return ForwardCall(upstream_, exchange);
  if (desk_ != nullptr && exchange->request().target() == "/local/watch") return desk_->Watch(exchange);
  std::string type;
  absl::StatusOr<std::string> body = Local(exchange->request(), &type);
  if (!body.ok()) return ReplyStatus(exchange.get(), body.status());
  HttpFields fields;
  fields.set(http::field::content_type, type);
  exchange->Reply(200, std::move(fields), *std::move(body));
}

void Workbench::AnswerStop(const std::shared_ptr<Exchange>& exchange) const {
  const HttpRequest& request = exchange->request();
  if (request.method() != http::verb::post || request.target() != "/local/stop")
    return ReplyStatus(exchange.get(), absl::NotFoundError("this port takes POST /local/stop alone"));
  const nlohmann::json said = nlohmann::json::parse(request.body(), nullptr, /*allow_exceptions=*/false);
  const bool has_token = said.is_object() && said.contains("token") && said["token"].is_string();
  const absl::Status allowed = CheckToken(has_token ? said["token"].get<std::string>() : "", token_);
  if (!allowed.ok()) return ReplyStatus(exchange.get(), allowed);
  const absl::StatusOr<std::string> answer = desk_->Stop(request.body());
  if (!answer.ok()) return ReplyStatus(exchange.get(), answer.status());
  HttpFields fields;
  fields.set(http::field::content_type, kJson);
  exchange->Reply(200, std::move(fields), *answer);
}

absl::StatusOr<std::string> Workbench::OfRig(const HttpRequest& request, std::string* type) const {
  const bool post = request.method() == http::verb::post;
  const absl::string_view target(request.target().data(), request.target().size());
  const bool of_rig = absl::StartsWith(target, "/local/rig") || target == "/local/stop" ||
                      target == "/local/watch" || target == "/local/evidence?rig";
  if (!of_rig) return absl::NotFoundError("there is nothing here; the page is at /");
  if (desk_ == nullptr)
    return absl::FailedPreconditionError("touchstone workbench was started without a rig (--rig HOST:PORT)");
  if (post && request.target() == "/local/stop") return desk_->Stop(request.body());
  if (post && request.target() == "/local/rig") {
    TOUCHSTONE_RETURN_IF_ERROR(desk_->Act(request.body()));
    return std::string("{}");
  }
  if (!post && request.target() == "/local/rig/drawing") return desk_->Drawing();
  *type = kBytes;
  if (!post && request.target() == "/local/rig/set.csv") return desk_->SetCsv();
  if (!post && request.target() == "/local/evidence?rig") {
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::Evidence evidence, desk_->Evidence());
    return evidence.SerializeAsString();
  }
  return absl::NotFoundError("there is nothing here; the page is at /");
}

absl::StatusOr<std::string> Workbench::Local(const HttpRequest& request, std::string* type) const {
  const auto is = [&](http::verb verb, const char* target) {
    return request.method() == verb && request.target() == target;
  };
  *type = kJson;
  if (is(http::verb::get, "/")) {
    *type = "text/html; charset=utf-8";
    return page_;
  }
  if (is(http::verb::get, "/local/state"))
    return nlohmann::json{{"evidence", options_.evidence.has_value()},
                          {"origin", options_.evidence ? options_.evidence->origin() : ""},
                          {"source", upstream_->server().address},
                          {"rig", desk_ ? desk_->address() : ""},
                          {"stop_port", stop_port()}}
        .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  if (is(http::verb::get, "/local/evidence") && options_.evidence) {
    *type = kBytes;
    return options_.evidence->SerializeAsString();
  }
  if (is(http::verb::get, "/local/evidence?example")) {
    *type = kBytes;
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::Evidence example, ExampleEvidence());
    return example.SerializeAsString();
  }
  if (is(http::verb::post, "/local/send-ahead")) {
    if (!options_.send_ahead_again)
      return absl::FailedPreconditionError(
          "/local/send-ahead: the evidence is whole, nothing was sent ahead");
    TOUCHSTONE_RETURN_IF_ERROR(options_.send_ahead_again(upstream_->server().channel));
    return std::string("{}");
  }
  if (is(http::verb::post, "/local/words")) {
    v1::Report report;
    if (!report.ParseFromString(request.body()))
      return absl::InvalidArgumentError("/local/words: the body is no touchstone.v1.Report");
    return client::PageData(report);
  }
  if (is(http::verb::post, "/local/model")) return ChangeModel(request.body());
  if (is(http::verb::get, "/local/formula")) return FormulaWords().dump();
  if (is(http::verb::post, "/local/formula")) return NamesInFormula(request.body());
  return OfRig(request, type);
}

}  // namespace touchstone::workbench
