// What the tests of a scripted rig's safety share.
#pragma once

#include <string>

#include "tests/physical/physical_test.h"

namespace touchstone {

class Safety : public PhysicalTest {
 protected:
  // Slow enough to be interrupted in mid-approach: 50 mm in about 1 s of the host's.
  static constexpr double kSlow = 0.00125;

  void Stop(const std::string& reason) {
    v1::StopRequest request;
    request.set_reason(reason);
    v1::StopResponse response;
    grpc::ClientContext context;
    ASSERT_TRUE(control_->Stop(&context, request, &response).ok());
  }
  grpc::Status PowerOn(const std::string& token) {
    v1::PowerOnRequest request;
    request.set_lease_token(token);
    v1::RigState state;
    grpc::ClientContext context;
    return rig_->PowerOn(&context, request, &state);
  }

  void WaitForRest() {
    WaitUntil([&] { return !emulator_->controller().Moving(); }, "the arm rests");
  }
  // Simulated seconds.
  void WaitForRigTime(double seconds) {
    const double until_s = emulator_->clock().NowS() + seconds;
    WaitUntil([&] { return emulator_->clock().NowS() >= until_s; }, "the rig's time passes");
  }

  // The touch that was interrupted can be made under its id; and then is answered without motion.
  void ExpectTheTouchCanBeMade(const v1::CommandedTouch& touch, const std::string& id) {
    KeptLease lease(control_.get(), "afterwards", true);
    ASSERT_TRUE(lease.status().ok()) << lease.status().error_message();
    Answer made;
    WaitUntil(
        [&] {
          made = Touch(lease.token(), touch, id);
          return made.status.ok();
        },
        "the touch is made");
    ASSERT_TRUE(made.status.ok()) << made.status.error_message();
    EXPECT_TRUE(made.response.results(0).complete());
    const uint64_t programs = emulator_->controller().Count("programs");
    const Answer again = Touch(lease.token(), touch, id);
    ASSERT_TRUE(again.status.ok()) << again.status.error_message();
    EXPECT_EQ(again.response.SerializeAsString(), made.response.SerializeAsString());
    EXPECT_EQ(emulator_->controller().Count("programs"), programs);
  }
};

}  // namespace touchstone
