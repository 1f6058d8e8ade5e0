#include "server/service/rpc/sessions_service.h"

#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "server/base/status.h"
#include "server/service/calls/list_page.h"
#include "server/service/core/convert.h"

namespace touchstone::service {

grpc::Status SessionsService::CreateSession(grpc::ServerContext* context,
                                            grpc::ServerReader<v1::CreateSessionRequest>* reader,
                                            v1::Session* response) {
  return ToGrpc(DoCreate(context, reader, response));
}

absl::Status SessionsService::DoCreate(grpc::ServerContext* context,
                                       grpc::ServerReader<v1::CreateSessionRequest>* reader,
                                       v1::Session* response) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const Places::Place place, resources_->uploads->Take(ClientOf(*context)));
  TOUCHSTONE_ASSIGN_OR_RETURN(MemoryBudget::Reservation memory, resources_->memory->Reserve(0));
  const RunningGuard running(&resources_->running_requests);
  SessionStore& store = *resources_->sessions;
  StallWatch::Call call(resources_->stalls.get(), context);
  v1::CreateSessionRequest request;
  const auto read = [&] { return reader->Read(&request); };
  if (!call.Wait(read))
    return absl::InvalidArgumentError("the stream is empty: its first message gives name, all of them csv");
  const std::string name = request.name();
  const bool validate_only = request.validate_only();
  // An invalid name is refused before a gigabyte is sent.
  if (!validate_only || !name.empty()) TOUCHSTONE_RETURN_IF_ERROR(SessionStore::CheckName(name));
  SessionStore::Upload upload(&store);
  do {
    if (!request.name().empty() && request.name() != name)
      return absl::InvalidArgumentError(
          absl::StrCat("name = '", request.name(), "': the first message said '", name, "'; say it once"));
    TOUCHSTONE_RETURN_IF_ERROR(memory.Grow(request.csv().size()));
    TOUCHSTONE_RETURN_IF_ERROR(upload.Append(request.file(), request.csv()));
  } while (call.Wait(read));

  // A stream that broke off looks like one that ended, and might even end with a whole row.
  if (context->IsCancelled()) return absl::CancelledError("the request was cancelled");

  const std::string origin = name.empty() ? "csv" : name;
  TOUCHSTONE_RETURN_IF_ERROR(memory.Grow(upload.BytesToRead()));
  TOUCHSTONE_ASSIGN_OR_RETURN(std::string bytes, upload.Take());
  TOUCHSTONE_ASSIGN_OR_RETURN(*response, validate_only ? DescribeSession(name, bytes, origin, store.limits())
                                                       : store.Create(name, std::move(bytes)));
  if (!validate_only)
    spdlog::info("session '{}' stored, {} touches, {} photographs, hash {}", name, response->touches(),
                 response->images(), response->hash().substr(0, 8));
  return absl::OkStatus();
}

grpc::Status SessionsService::ListSessions(grpc::ServerContext*, const v1::ListSessionsRequest* request,
                                           v1::ListSessionsResponse* response) {
  const auto size = PageSize(request->page_size(), resources_->options.max_page_size);
  if (!size.ok()) return ToGrpc(size.status());
  // A server has no trash.
  const auto names = request->deleted() ? std::vector<std::string>() : resources_->sessions->Names();
  const auto first = std::upper_bound(names.begin(), names.end(), request->page_token());
  const auto add = [&](const std::string& name) -> size_t {
    auto session = resources_->sessions->Find(name);
    if (!session.ok()) return 0;  // deleted a moment ago, or a file that is no session
    response->add_sessions()->Swap(&*session);
    return response->sessions().rbegin()->ByteSizeLong();
  };
  FillPage(
      absl::MakeConstSpan(names).subspan(first - names.begin()), *size, add,
      [](const std::string& name) { return name; }, response->mutable_next_page_token());
  return grpc::Status::OK;
}

grpc::Status SessionsService::GetSession(grpc::ServerContext*, const v1::GetSessionRequest* request,
                                         v1::Session* response) {
  auto session = resources_->sessions->Find(request->name());
  if (!session.ok()) return ToGrpc(session.status());
  *response = *std::move(session);
  return grpc::Status::OK;
}

grpc::Status SessionsService::ExportSession(grpc::ServerContext* context,
                                            const v1::ExportSessionRequest* request,
                                            grpc::ServerWriter<v1::ExportSessionResponse>* writer) {
  bool gone = false;
  StallWatch::Call call(resources_->stalls.get(), context);
  v1::ExportSessionResponse response;
  const absl::Status status =
      resources_->sessions->Export(request->name(), [&](const std::string& file, absl::string_view piece) {
        response.set_file(file);
        response.set_csv(std::string(piece));
        gone = !call.Wait([&] { return writer->Write(response); });
        return !gone;
      });
  return ToGrpc(gone ? absl::CancelledError("the client is gone") : status);
}

grpc::Status SessionsService::DeleteSession(grpc::ServerContext*, const v1::DeleteSessionRequest* request,
                                            v1::DeleteSessionResponse*) {
  const absl::Status status = resources_->sessions->Delete(request->name());
  if (status.ok()) spdlog::info("session '{}' deleted", request->name());
  return ToGrpc(status);
}

grpc::Status SessionsService::RestoreSession(grpc::ServerContext*, const v1::RestoreSessionRequest* request,
                                             v1::Session*) {
  if (request->name().empty())
    return {grpc::StatusCode::INVALID_ARGUMENT, "name: say which session is to come back"};
  return {grpc::StatusCode::UNIMPLEMENTED,
          "a touchstone-server has no trash, so a session that was deleted here is gone; a "
          "touchstone-gateway has one"};
}

}  // namespace touchstone::service
