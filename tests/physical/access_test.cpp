// Who may do what at a rig, and that its audit says who did.
#include <gmock/gmock.h>

#include <fstream>

#include "server/service/core/access.h"
#include "server/service/tests/test_call.h"
#include "tests/physical/physical_test.h"

namespace touchstone {
namespace {

using service::Role;
using testing::HasSubstr;

class RigAccess : public PhysicalTest {
 protected:
  // A gateway that asks for tokens. Nobody waits for the rig: what is refused is refused without one too.
  void StartAsking() {
    StartRig();
    std::string text;
    for (const Role role : {Role::kReader, Role::kOperator, Role::kAdmin}) {
      tokens_[role] = service::NewAccessToken();
      text += std::string("lab-") + RoleName(role) + " " + RoleName(role) + " " +
              service::HashOfToken(tokens_[role]) + "\n";
    }
    std::ofstream(folder_.Path("tokens")) << text;
    const std::string config = emulator_->config_path(), tokens = folder_.Path("tokens");
    const char* argv[] = {"touchstone-gateway",     "--config", config.c_str(), "--listen",    "127.0.0.1:0",
                          "--supershape-triangles", "2000",     "--token-file", tokens.c_str()};
    auto parsed = service::ParseGatewayFlags(sizeof argv / sizeof *argv, argv);
    ASSERT_TRUE(parsed.ok()) << parsed.status();
    auto gateway = service::GatewayServer::Start(parsed->options);
    ASSERT_TRUE(gateway.ok()) << gateway.status();
    gateway_ = *std::move(gateway);
    channel_ = grpc::CreateChannel("127.0.0.1:" + std::to_string(gateway_->port()),
                                   grpc::InsecureChannelCredentials());
  }

  std::map<Role, std::string> tokens_;
};

TEST(GatewayOptions, AnEmulatedClockIsRefusedBeforeAnArmOnAnotherMachine) {
  const auto parse = [](const char* address) {
    const char* argv[] = {"touchstone-gateway", "--emulated-clock", "clock", "--arm-address", address,
                          "--effector-port",    "/dev/ttyACM0"};
    return service::ParseGatewayFlags(sizeof argv / sizeof *argv, argv).status();
  };
  EXPECT_TRUE(parse("127.0.0.1").ok()) << parse("127.0.0.1");
  EXPECT_EQ(parse("192.168.0.10").code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(parse("192.168.0.10").message(),
              testing::HasSubstr("'192.168.0.10': leave emulated_clock out"));
}

TEST_F(RigAccess, EveryMethodTakesItsRoleAndRefusesEachLowerOne) {
  StartAsking();
  for (const service::MethodRole& row : service::MethodRoles()) {
    if (row.rig == Role::kNobody) continue;
    EXPECT_EQ(service::CallAny(channel_, row.method, "").error_code(), grpc::UNAUTHENTICATED) << row.method;
    for (const auto& [role, token] : tokens_) {
      const grpc::Status status = service::CallAny(channel_, row.method, token);
      EXPECT_EQ(status.error_code() == grpc::PERMISSION_DENIED, role < row.rig)
          << row.method << status.error_message();
      if (role < row.rig) {
        EXPECT_THAT(status.error_message(),
                    HasSubstr(service::MethodName(row.method) + " needs the role " + RoleName(row.rig)));
      }
    }
  }
}

TEST_F(RigAccess, TheAuditSaysWhoWasFoundToCall) {
  StartAsking();
  const auto control = v1::Control::NewStub(channel_);
  v1::AcquireLeaseRequest acquire;
  acquire.set_holder("ana@bench2");
  acquire.set_take(true);
  v1::Lease lease;
  grpc::ClientContext reading, acquiring, stopping;
  reading.AddMetadata("authorization", "Bearer " + tokens_[Role::kReader]);
  EXPECT_EQ(control->AcquireLease(&reading, acquire, &lease).error_code(), grpc::PERMISSION_DENIED);
  acquiring.AddMetadata("authorization", "Bearer " + tokens_[Role::kOperator]);
  ASSERT_TRUE(control->AcquireLease(&acquiring, acquire, &lease).ok());
  v1::StopRequest stop;
  stop.set_reason("seen from the door");
  v1::StopResponse stopped;
  stopping.AddMetadata("authorization", "Bearer " + tokens_[Role::kReader]);
  EXPECT_TRUE(control->Stop(&stopping, stop, &stopped).ok());
  StopGateway();
  std::ifstream file(folder_.Path("rig/audit.jsonl"));
  const std::string audit((std::istreambuf_iterator<char>(file)), {});
  EXPECT_THAT(audit, HasSubstr("\"holder\":\"ana@bench2 (lab-operator, operator)\""));
  EXPECT_THAT(audit, HasSubstr("somebody (lab-reader, reader)"));
  EXPECT_THAT(audit, HasSubstr("\"lease_holder\":\"ana@bench2 (lab-operator, operator)\""));
  for (const auto& [role, token] : tokens_) EXPECT_THAT(audit, testing::Not(HasSubstr(token)));
}

}  // namespace
}  // namespace touchstone
