// touchstone.v1.Sessions over a journal: its sessions as measurement files, with photographs as image sets.
#pragma once

#include "server/gateway/audit/audit_log.h"
#include "server/service/calls/lease_book.h"
#include "server/service/core/resources.h"
#include "server/session/journal/journal.h"
#include "touchstone/v1/sessions.grpc.pb.h"

namespace touchstone::service {

class JournalSessionsService final : public v1::Sessions::Service {
 public:
  // `audit` may be null: a recorded session is served, which nobody deletes.
  JournalSessionsService(const Resources* resources, session::Journal* journal, const LeaseBook* leases,
                         gateway::audit::AuditLog* audit)
      : resources_(resources), journal_(journal), leases_(leases), audit_(audit) {}

  // A rig's sessions come from touching; UNIMPLEMENTED says so.
  grpc::Status CreateSession(grpc::ServerContext*, grpc::ServerReader<v1::CreateSessionRequest>*,
                             v1::Session*) override;
  // Without hashes and sizes, for which every file would have to be made.
  grpc::Status ListSessions(grpc::ServerContext*, const v1::ListSessionsRequest*,
                            v1::ListSessionsResponse*) override;
  grpc::Status GetSession(grpc::ServerContext*, const v1::GetSessionRequest*, v1::Session*) override;
  grpc::Status ExportSession(grpc::ServerContext*, const v1::ExportSessionRequest*,
                             grpc::ServerWriter<v1::ExportSessionResponse>*) override;
  grpc::Status DeleteSession(grpc::ServerContext*, const v1::DeleteSessionRequest*,
                             v1::DeleteSessionResponse*) override;
  grpc::Status RestoreSession(grpc::ServerContext*, const v1::RestoreSessionRequest*, v1::Session*) override;

 private:
  // That the caller may change sessions; then a line of the audit log says who does it, before it is done.
  absl::Status Admit(const std::string& lease_token, const char* event, const std::string& session);

  const Resources* const resources_;
  session::Journal* const journal_;
  const LeaseBook* const leases_;
  gateway::audit::AuditLog* const audit_;
};

}  // namespace touchstone::service
