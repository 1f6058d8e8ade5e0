// An end effector that is there and never feels anything, for tests of motions that are no touches.
#pragma once

#include "server/gateway/effector/effector.h"

namespace touchstone::gateway {

class IdleEffector final : public effector::Effector {
 public:
  absl::Status StartCapture(uint32_t, const std::function<absl::Status()>&) override {
    return absl::OkStatus();
  }
  absl::Status EndCapture() override { return absl::OkStatus(); }
  absl::StatusOr<effector::EffectorTouch> Touch() const override { return absl::NotFoundError("none"); }
  absl::StatusOr<effector::EffectorTouch> Recall(uint32_t) override { return absl::NotFoundError("none"); }
  effector::EffectorState State() const override {
    effector::EffectorState state;
    state.connected = true;
    return state;
  }
  timing::ClockEstimate Clock() const override { return {}; }
};

}  // namespace touchstone::gateway
