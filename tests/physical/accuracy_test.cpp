// Contact times against the emulator's truth.
#include <cmath>

#include "tests/physical/physical_test.h"

namespace touchstone {
namespace {

class Accuracy : public PhysicalTest {
 protected:
  // Contacts lie 0.7 s apart at most: the rate of the end effector's clock is known so well that this is 14 us of them. On a
  // machine that does other things the messages that tell the rate come later.
  void WaitUntilClockIsKnown() {
    WaitUntil(
        [this] {
          const v1::EffectorStatus& effector = RigState().effector();
          return effector.clock_drift_uncertainty() > 0 && effector.clock_drift_uncertainty() < 20e-6;
        },
        "the rate of the end effector's clock is known");
  }
};

TEST_F(Accuracy, DifferencesOfContactTimesAreRightDespiteDriftAndADelayingLine) {
  StartRig([](rig::EmulatorOptions* options) {
    options->speedup = 8;
    options->drift_ppm = 100;
    options->faults = {{"line_delay_ms", 5}};
  });
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  WaitUntilClockIsKnown();
  for (int k = 0; k < 6; ++k) {
    const Answer answer = Touch(lease.token(), FromAbove(0.02, k % 4), "touch " + std::to_string(k));
    ASSERT_TRUE(answer.status.ok()) << answer.status.error_message();
    const rig::TouchTruth truth = emulator_->Touches().back();
    for (int i = 1; i < 3; ++i) {
      const double measured_s =
          answer.response.results(0).contact_time_s(i) - answer.response.results(0).contact_time_s(0);
      EXPECT_NEAR(measured_s, truth.reported_s[i] - truth.reported_s[0], 50e-6)
          << "touch " << k << ", finger " << i;
    }
    EXPECT_NEAR(answer.response.results(0).measured().speed_m_s(), 0.02, 1e-4);
  }
}

// PROTOCOL.md: a bounce of up to the debounce time costs no accuracy.
TEST_F(Accuracy, ABouncingSwitchCostsNone) {
  StartRig([](rig::EmulatorOptions* options) {
    options->sensor = "microswitch";
    options->faults = {{"bounce", 1}};
  });
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  WaitUntilClockIsKnown();
  for (int k = 0; k < 4; ++k) {
    const Answer answer = Touch(lease.token(), FromAbove(0.02, k % 3), "touch " + std::to_string(k));
    ASSERT_TRUE(answer.status.ok()) << answer.status.error_message();
    const rig::TouchTruth truth = emulator_->Touches().back();
    for (int i = 1; i < 3; ++i)
      EXPECT_NEAR(answer.response.results(0).contact_time_s(i) - answer.response.results(0).contact_time_s(0),
                  truth.reported_s[i] - truth.reported_s[0], 50e-6)
          << "touch " << k << ", finger " << i;
  }
}

TEST_F(Accuracy, PosesAtContactAreWhereTheTipWas) {
  StartRig([](rig::EmulatorOptions* options) { options->speedup = 4; });
  StartGateway();
  KeptLease lease(control_.get(), "client", true);
  for (int k = 0; k < 6; ++k) {
    const Answer answer = Touch(lease.token(), FromAbove(0.02, k % 3), "touch " + std::to_string(k));
    ASSERT_TRUE(answer.status.ok()) << answer.status.error_message();
    if (k < 2) continue;
    const rig::TouchTruth truth = emulator_->Touches().back();
    const v1::Measured& measured = answer.response.results(0).measured();
    ASSERT_EQ(measured.base_from_tip_at_contact_size(), 3);
    // All three are on one straight way down; heights differ as the travels do. The sensor's noise moves the
    // edge, so compare with the travel at the reported moment.
    for (int i = 1; i < 3; ++i) {
      const double lower_m = measured.base_from_tip_at_contact(0).position_m().z() -
                             measured.base_from_tip_at_contact(i).position_m().z();
      // The pose of a contact comes from states of 7 um of noise each, twice as good from four times as many.
      EXPECT_NEAR(lower_m, 0.02 * (truth.reported_s[i] - truth.reported_s[0]), Cb3() ? 4e-5 : 2e-5);
    }
  }
}

}  // namespace
}  // namespace touchstone
