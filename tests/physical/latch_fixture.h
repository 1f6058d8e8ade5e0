// What the tests of the latch share: whatever closed it, nothing moves until a person's reset.
#pragma once

#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "tests/physical/safety_fixture.h"

namespace touchstone {

class Latch : public Safety {
 protected:
  // At this speed a controller of either series tells the five states that a short approach needs.
  static double QuickMS() { return Cb3() ? 0.03 : 0.05; }

  v1::State Whole() {
    v1::State state;
    grpc::ClientContext context;
    EXPECT_TRUE(control_->GetState(&context, {}, &state).ok());
    return state;
  }
  std::string StopReason() { return Whole().stop_reason(); }

  std::vector<std::string> CommandsSince(size_t first) const {
    const std::vector<std::string> all = emulator_->controller().Commands();
    return {all.begin() + static_cast<std::ptrdiff_t>(std::min(first, all.size())), all.end()};
  }
  size_t CommandCount() const { return emulator_->controller().Commands().size(); }

  // The command line, beside this program.
  static std::string Touchstone() {
    return std::filesystem::read_symlink("/proc/self/exe").parent_path() / "touchstone";
  }

  // Every kind of motion and power, again and again: refused, and nothing reaches the controller.
  void ExpectNothingMovesUntilReset(const std::string& because) {
    const size_t commands = CommandCount();
    for (int k = 0; k < 5; ++k) {
      KeptLease lease(control_.get(), "retries", true);
      ASSERT_TRUE(lease.status().ok()) << lease.status().error_message();
      v1::HomeRequest home;
      home.set_lease_token(lease.token());
      v1::MountObjectRequest mount;
      mount.set_object("lat10");
      mount.set_lease_token(lease.token());
      v1::RigState rig;
      grpc::ClientContext homing, mounting;
      for (const auto& [what, status] : {std::pair<const char*, grpc::Status>{
                                             "touch", Touch(lease.token(), FromAbove(), "refused").status},
                                         {"power-on", PowerOn(lease.token())},
                                         {"home", rig_->Home(&homing, home, &rig)},
                                         {"mount", rig_->MountObject(&mounting, mount, &rig)}}) {
        EXPECT_THAT(status.error_code(), testing::AnyOf(grpc::ABORTED, grpc::FAILED_PRECONDITION)) << what;
        EXPECT_THAT(status.error_message(),
                    testing::AllOf(testing::HasSubstr(because), testing::HasSubstr("rig reset")))
            << what;
      }
    }
    EXPECT_THAT(CommandsSince(commands), testing::Each("program stop_motion"))
        << "the controller was told something by what is refused";
    EXPECT_THAT(StopReason(), testing::HasSubstr(because));
  }
};

}  // namespace touchstone
