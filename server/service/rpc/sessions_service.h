// touchstone.v1.Sessions: the store of measured sets.
#pragma once

#include "server/service/core/resources.h"
#include "touchstone/v1/sessions.grpc.pb.h"

namespace touchstone::service {

class SessionsService final : public v1::Sessions::Service {
 public:
  explicit SessionsService(Resources* resources) : resources_(resources) {}

  grpc::Status CreateSession(grpc::ServerContext*, grpc::ServerReader<v1::CreateSessionRequest>*,
                             v1::Session*) override;
  grpc::Status ListSessions(grpc::ServerContext*, const v1::ListSessionsRequest*,
                            v1::ListSessionsResponse*) override;
  grpc::Status GetSession(grpc::ServerContext*, const v1::GetSessionRequest*, v1::Session*) override;
  grpc::Status ExportSession(grpc::ServerContext*, const v1::ExportSessionRequest*,
                             grpc::ServerWriter<v1::ExportSessionResponse>*) override;
  grpc::Status DeleteSession(grpc::ServerContext*, const v1::DeleteSessionRequest*,
                             v1::DeleteSessionResponse*) override;
  // UNIMPLEMENTED: there is no trash here.
  grpc::Status RestoreSession(grpc::ServerContext*, const v1::RestoreSessionRequest*, v1::Session*) override;

 private:
  absl::Status DoCreate(grpc::ServerContext* context, grpc::ServerReader<v1::CreateSessionRequest>* reader,
                        v1::Session* response);

  Resources* resources_;
};

}  // namespace touchstone::service
