#include "client/workbench_server/workbench.h"

#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include <boost/beast/http/field.hpp>
#include <boost/beast/http/verb.hpp>

#include "client/report/report.h"
#include "client/workbench/page.h"
#include "client/workbench_server/bridge.h"
#include "client/workbench_server/example.h"
#include "client/workbench_server/model_edit.h"
#include "client/workbench_server/request_guard.h"
#include "server/base/status.h"

namespace touchstone::workbench {
namespace {

namespace http = boost::beast::http;
constexpr char kJson[] = "application/json";
constexpr char kBytes[] = "application/octet-stream";

}  // namespace

absl::StatusOr<std::unique_ptr<Workbench>> Workbench::Start(WorkbenchOptions options) {
  std::unique_ptr<Workbench> workbench(new Workbench);
  TOUCHSTONE_ASSIGN_OR_RETURN(workbench->page_, FilledPage("{\"live\":true}", PageReach::kOwnOrigin));
  workbench->token_ = NewToken();
  HttpOptions served;
  served.port = options.port;
  served.limits = options.limits;
  served.token = workbench->token_;
  workbench->options_ = std::move(options);
  TOUCHSTONE_ASSIGN_OR_RETURN(
      workbench->http_, HttpServer::Start(std::move(served), [self = workbench.get()](const auto& exchange) {
        self->Answer(exchange);
      }));
  return workbench;
}

std::string Workbench::Url() const {
  return absl::StrCat("http://127.0.0.1:", port(), "/#token=", token_);
}

void Workbench::Answer(const std::shared_ptr<Exchange>& exchange) const {
  if (IsGrpcWeb(exchange->request())) return ForwardCall(options_.channel, exchange);
  std::string type;
  absl::StatusOr<std::string> body = Local(exchange->request(), &type);
  if (!body.ok()) return ReplyStatus(exchange.get(), body.status());
  HttpFields fields;
  fields.set(http::field::content_type, type);
  exchange->Reply(200, std::move(fields), *std::move(body));
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
                          {"source", options_.address}}
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
  if (is(http::verb::post, "/local/words")) {
    v1::Report report;
    if (!report.ParseFromString(request.body()))
      return absl::InvalidArgumentError("/local/words: the body is no touchstone.v1.Report");
    return client::PageData(report);
  }
  if (is(http::verb::post, "/local/model")) return ChangeModel(request.body());
  return absl::NotFoundError("there is nothing here; the page is at /");
}

}  // namespace touchstone::workbench
