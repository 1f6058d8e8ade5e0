// touchstone.v1.Sessions over a journal: its sessions as measurement files.
#pragma once

#include "server/session/journal.h"
#include "touchstone/v1/sessions.grpc.pb.h"

namespace touchstone::service {

class JournalSessionsService final : public v1::Sessions::Service {
 public:
  JournalSessionsService(session::Journal* journal, bool writable) : journal_(journal), writable_(writable) {}

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

 private:
  session::Journal* journal_;
  const bool writable_;
};

}  // namespace touchstone::service
