#include "server/service/gateway/journal_sessions_service.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <spdlog/spdlog.h>

#include <optional>
#include <utility>
#include <vector>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/service/calls/list_page.h"
#include "server/service/core/convert.h"
#include "server/service/sessions/journalled_session.h"

namespace touchstone::service {
namespace {

// What the journal knows of a session; without the size and hash of its file.
v1::Session SessionToProto(const session::JournalSession& session) {
  v1::Session message;
  message.set_name(session.name);
  message.set_touches(session.done);
  message.set_fingers(session.fingers);
  for (const std::string& object : session.objects) message.add_objects(object);
  message.set_has_poses(true);
  message.set_images(session.images);
  message.set_deleted_unix_s(session.deleted_unix_s);
  message.set_deleted_by(session.deleted_by);
  return message;
}

// Where a session stands in either list: rising among those that are there, falling in the trash.
using Place = std::pair<double, int64_t>;

Place PlaceOf(const session::JournalSession& session) {
  return {session.deleted_unix_s, session.id};
}

// Nothing: the list's beginning.
absl::StatusOr<std::optional<Place>> PlaceOf(const std::string& page_token) {
  if (page_token.empty()) return std::nullopt;
  Place place;
  const std::vector<absl::string_view> parts = absl::StrSplit(page_token, ' ');
  if (parts.size() != 2 || !absl::SimpleAtod(parts[0], &place.first) ||
      !absl::SimpleAtoi(parts[1], &place.second))
    return WrongPageToken(page_token);
  return place;
}

}  // namespace

grpc::Status JournalSessionsService::CreateSession(grpc::ServerContext*,
                                                   grpc::ServerReader<v1::CreateSessionRequest>*,
                                                   v1::Session*) {
  return grpc::Status(
      grpc::UNIMPLEMENTED,
      "a gateway's sessions come from touching; touchstone session import FILE -o SESSION.db makes one "
      "from a file, which touchstone-gateway --replay serves");
}

grpc::Status JournalSessionsService::ListSessions(grpc::ServerContext*,
                                                  const v1::ListSessionsRequest* request,
                                                  v1::ListSessionsResponse* response) {
  const auto size = PageSize(request->page_size(), resources_->options.max_page_size);
  if (!size.ok()) return ToGrpc(size.status());
  const auto from = PlaceOf(request->page_token());
  if (!from.ok()) return ToGrpc(from.status());
  const bool deleted = request->deleted();
  const auto sessions = deleted ? journal_->DeletedSessions() : journal_->Sessions();
  if (!sessions.ok()) return ToGrpc(sessions.status());
  auto first = sessions->begin();
  if (from->has_value())
    while (first != sessions->end() && (deleted ? PlaceOf(*first) >= **from : PlaceOf(*first) <= **from))
      ++first;
  const auto add = [&](const session::JournalSession& session) {
    v1::Session* const message = response->add_sessions();
    *message = SessionToProto(session);
    return message->ByteSizeLong();
  };
  const auto token = [](const session::JournalSession& session) {
    return absl::StrCat(ShortestNumber(session.deleted_unix_s), " ", session.id);
  };
  FillPage(absl::MakeConstSpan(*sessions).subspan(first - sessions->begin()), *size, add, token,
           response->mutable_next_page_token());
  return grpc::Status::OK;
}

grpc::Status JournalSessionsService::GetSession(grpc::ServerContext*, const v1::GetSessionRequest* request,
                                                v1::Session* response) {
  const auto session = journal_->Session(request->name());
  if (!session.ok()) return ToGrpc(session.status());
  *response = SessionToProto(*session);
  const auto made = FilesOfJournal(*journal_, *session);
  // Photographs that no file can hold are described all the same.
  if (absl::IsFailedPrecondition(made.status())) return grpc::Status::OK;
  if (!made.ok()) return ToGrpc(made.status());
  if (!made->files.images) {
    response->set_hash(Sha256Hex(made->files.csv));
    response->set_bytes(made->files.csv.size());
    return grpc::Status::OK;
  }
  // As a server describes what it keeps, so that an imported session can be compared with the rig's.
  const auto stored = DescribeSession(session->name, PackSession(made->files), session->name);
  if (!stored.ok()) return ToGrpc(stored.status());
  response->set_hash(stored->hash());
  response->set_bytes(stored->bytes());
  *response->mutable_objects() = stored->objects();
  return grpc::Status::OK;
}

grpc::Status JournalSessionsService::ExportSession(grpc::ServerContext* context,
                                                   const v1::ExportSessionRequest* request,
                                                   grpc::ServerWriter<v1::ExportSessionResponse>* writer) {
  const auto session = journal_->Session(request->name());
  if (!session.ok()) return ToGrpc(session.status());
  const auto made = FilesOfJournal(*journal_, *session);
  if (!made.ok()) return ToGrpc(made.status());
  if (!made->left_out.empty()) context->AddTrailingMetadata(kLeftOutMetadata, made->left_out);
  bool gone = false;
  StallWatch::Call call(resources_->stalls.get(), context);
  v1::ExportSessionResponse response;
  const absl::Status status = ForEachPiece(PackSession(made->files), kSessionPieceBytes,
                                           [&](const std::string& file, absl::string_view piece) {
                                             response.set_file(file);
                                             response.set_csv(std::string(piece));
                                             gone = !call.Wait([&] { return writer->Write(response); });
                                             return !gone;
                                           });
  return ToGrpc(gone ? absl::CancelledError("the client is gone") : status);
}

absl::Status JournalSessionsService::Admit(const std::string& lease_token, const char* event,
                                           const std::string& session) {
  if (audit_ == nullptr) return absl::FailedPreconditionError("a recorded session is served read-only");
  TOUCHSTONE_RETURN_IF_ERROR(leases_->Check(lease_token));
  return audit_->Write(event, {{"who", leases_->Holder()}, {"session", session}});
}

grpc::Status JournalSessionsService::DeleteSession(grpc::ServerContext*,
                                                   const v1::DeleteSessionRequest* request,
                                                   v1::DeleteSessionResponse*) {
  const std::string& name = request->name();
  const char* const event = request->purge() ? "purge_session" : "delete_session";
  absl::Status status = Admit(request->lease_token(), event, name);
  if (status.ok())
    status =
        request->purge() ? journal_->PurgeSession(name) : journal_->DeleteSession(name, leases_->Holder());
  if (status.ok()) spdlog::info("{} '{}' by {}", event, name, leases_->Holder());
  return ToGrpc(status);
}

grpc::Status JournalSessionsService::RestoreSession(grpc::ServerContext*,
                                                    const v1::RestoreSessionRequest* request,
                                                    v1::Session* response) {
  absl::Status status = Admit(request->lease_token(), "restore_session", request->name());
  if (status.ok()) status = journal_->RestoreSession(request->name());
  if (!status.ok()) return ToGrpc(status);
  const auto session = journal_->Session(request->name());
  if (!session.ok()) return ToGrpc(session.status());
  *response = SessionToProto(*session);
  return grpc::Status::OK;
}

}  // namespace touchstone::service
