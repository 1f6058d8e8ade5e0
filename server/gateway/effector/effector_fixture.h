// A fake end effector and an Effector that talks to it over a pseudo-terminal: what the tests of Effector start from.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "server/gateway/effector/effector.h"
#include "server/gateway/effector/fake_device.h"

namespace touchstone::gateway::effector {

inline constexpr double kLongS = 30;  // the machine may be busy

class EffectorFixture : public testing::Test {
 protected:
  EffectorOptions Options(int fingers = 3) const {
    EffectorOptions options;
    if (device_ != nullptr) options.port = device_->port();
    options.fingers = std::vector<EffectorFinger>(fingers);
    options.reply_timeout_s = 0.1;
    options.silence_s = 600;  // a device that has not had the processor is not lost
    options.clock_query_s = 0.01;
    return options;
  }
  void Start(const FakeDevice::Options& device = FakeDevice::Options()) {
    device_ = std::make_unique<FakeDevice>(device);
  }
  void Open(const EffectorOptions& options) {
    absl::StatusOr<std::unique_ptr<Effector>> effector = Effector::Open(options, &changes_);
    ASSERT_TRUE(effector.ok()) << effector.status();
    effector_ = *std::move(effector);
  }
  bool WaitFor(const std::function<bool()>& done) {
    const double until_s = timing::HostNowS() + kLongS;
    while (timing::HostNowS() < until_s) {
      const uint64_t seen = changes_.count();
      if (done()) return true;
      changes_.WaitForChange(seen, 0.02);  // not every change that tests look at is notified
    }
    return false;
  }
  bool WaitForConnection(bool connected = true) {
    return WaitFor([&] { return effector_->State().connected == connected; });
  }
  bool WaitForContacts(int contacts) {
    return WaitFor([&] {
      const absl::StatusOr<EffectorTouch> touch = effector_->Touch();
      return touch.ok() && touch->Contacts() == contacts;
    });
  }
  absl::Status StartCapturePatiently(uint32_t touch) {
    absl::Status status;
    for (int i = 0; i < 50; ++i) {
      status = effector_->StartCapture(touch);
      if (!absl::IsUnavailable(status)) return status;
      WaitForConnection();
    }
    return status;
  }

  timing::ChangeNotifier changes_;
  std::unique_ptr<FakeDevice> device_;
  std::unique_ptr<Effector> effector_;
};

}  // namespace touchstone::gateway::effector
