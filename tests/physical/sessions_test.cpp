// The sessions of a gateway: who may delete them, and that they come back. The emulated rig's data stand for no
// measurement.
#include <gmock/gmock.h>

#include "server/base/text/text.h"
#include "tests/physical/physical_test.h"
#include "touchstone/v1/sessions.grpc.pb.h"

namespace touchstone {
namespace {

using testing::HasSubstr;

class GatewaySessionsTest : public PhysicalTest {
 protected:
  grpc::Status Delete(const std::string& token, bool purge = false) {
    v1::DeleteSessionRequest request;
    request.set_name("test");
    request.set_lease_token(token);
    request.set_purge(purge);
    v1::DeleteSessionResponse response;
    grpc::ClientContext context;
    return v1::Sessions::NewStub(channel_)->DeleteSession(&context, request, &response);
  }
  grpc::Status Restore(const std::string& token) {
    v1::RestoreSessionRequest request;
    request.set_name("test");
    request.set_lease_token(token);
    v1::Session response;
    grpc::ClientContext context;
    return v1::Sessions::NewStub(channel_)->RestoreSession(&context, request, &response);
  }
  v1::ListSessionsResponse List(bool deleted) {
    v1::ListSessionsRequest request;
    request.set_deleted(deleted);
    v1::ListSessionsResponse response;
    grpc::ClientContext context;
    EXPECT_TRUE(v1::Sessions::NewStub(channel_)->ListSessions(&context, request, &response).ok());
    return response;
  }
};

TEST_F(GatewaySessionsTest, AreDeletedByWhoHoldsTheLeaseAndComeBackFromTheTrash) {
  StartRig([](rig::EmulatorOptions* options) { options->speedup = 8; });
  StartGateway();
  KeptLease lease(control_.get(), "ana@lab", true);
  const Answer first = Touch(lease.token(), FromAbove(), "a");
  ASSERT_TRUE(first.status.ok()) << first.status.error_message();

  for (const std::string& token : {std::string(), std::string("stale")}) {
    const grpc::Status refused = Delete(token);
    EXPECT_FALSE(refused.ok());
    EXPECT_THAT(refused.error_message(), HasSubstr("lease"));
    EXPECT_FALSE(Restore(token).ok());
  }
  EXPECT_EQ(List(false).sessions_size(), 1);

  ASSERT_TRUE(Delete(lease.token()).ok());
  EXPECT_EQ(List(false).sessions_size(), 0);
  ASSERT_EQ(List(true).sessions_size(), 1);
  EXPECT_THAT(List(true).sessions(0).deleted_by(), HasSubstr("ana@lab"));
  EXPECT_GT(List(true).sessions(0).deleted_unix_s(), 1.7e9);
  ASSERT_TRUE(Restore(lease.token()).ok());
  const Answer again = Touch(lease.token(), FromAbove(), "a");
  EXPECT_EQ(again.response.SerializeAsString(), first.response.SerializeAsString());

  // The name is free after it was deleted: the same id stands for a new touch.
  ASSERT_TRUE(Delete(lease.token()).ok());
  const Answer other = Touch(lease.token(), FromAbove(0.02, 1), "a");
  EXPECT_TRUE(other.status.ok()) << other.status.error_message();
  EXPECT_EQ(Restore(lease.token()).error_code(), grpc::StatusCode::ALREADY_EXISTS);
  ASSERT_TRUE(Delete(lease.token(), true).ok());
  EXPECT_EQ(List(true).sessions_size(), 0);
  EXPECT_EQ(List(false).sessions_size(), 1);

  const auto audit = ReadFile(folder_.Path("rig/audit.jsonl"));
  ASSERT_TRUE(audit.ok()) << audit.status();
  for (const char* event : {"delete_session", "restore_session", "purge_session"}) {
    const size_t place = audit->find(event);
    ASSERT_NE(place, std::string::npos) << event;
    EXPECT_THAT(audit->substr(place, audit->find('\n', place) - place), HasSubstr("ana@lab"));
  }
}

}  // namespace
}  // namespace touchstone
