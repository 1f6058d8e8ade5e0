// An emulated rig, a gateway that drives it, and a client of the gateway. The emulator's data stand
// for no measurement.
#pragma once

#include <atomic>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include "server/base/test_folder.h"
#include "server/base/threads/manual_clock.h"
#include "server/service/gateway/gateway_server.h"
#include "server/session/journal/journal.h"
#include "tests/rig/emulator.h"
#include "touchstone/v1/control.grpc.pb.h"
#include "touchstone/v1/rig.grpc.pb.h"
#include "touchstone/v1/source.grpc.pb.h"

namespace touchstone {

// A lease that is renewed until it is dropped.
class KeptLease {
 public:
  KeptLease(v1::Control::Stub* control, const std::string& holder, bool take);
  ~KeptLease();
  const std::string& token() const { return lease_.token(); }
  const grpc::Status& status() const { return status_; }
  double window_s() const { return lease_.window_s(); }
  void StopRenewing();

 private:
  v1::Control::Stub* control_;
  v1::Lease lease_;
  grpc::Status status_;
  std::atomic<bool> ending_{false};
  std::thread keeper_;
};

class PhysicalTest : public testing::Test {
 protected:
  ~PhysicalTest() override;

  // The tests were started for a CB3 controller, which sends a quarter of the states: TOUCHSTONE_TEST_ARM is ur3.
  static bool Cb3();

  // With changes to the emulator's options before it begins. Touches from above of lat00 need no change
  // of the object.
  void StartRig(const std::function<void(rig::EmulatorOptions*)>& change = nullptr);
  // In this process, where leases run out as the test moves lease_clock_, or (over the program touchstone-gateway) in
  // another one that can be killed.
  void StartGateway(std::vector<std::string> flags = {});
  void StopGateway();
  void StartGatewayProcess();
  void KillGatewayProcess();
  void AwaitGatewayProcess();                         // it was told to end
  pid_t gateway_process() const { return process_; }  // 0: none

  // A touch of lat00 from above, 10 mm to the side for every unit of `which`.
  v1::CommandedTouch FromAbove(double speed_m_s = 0.02, double which = 0) const;
  struct Answer {
    grpc::Status status;
    v1::TouchResponse response;
  };
  Answer Touch(const std::string& token, const v1::CommandedTouch& touch, const std::string& id,
               const std::string& object = "lat00");
  std::future<Answer> TouchLater(const std::string& token, const v1::CommandedTouch& touch,
                                 const std::string& id);
  // Waits, a minute at most.
  static void WaitUntil(const std::function<bool()>& done, const char* what);
  void WaitUntilApproaching();
  // Of another program than this one, whose phase the controller's registers keep.
  void WaitUntilApproachingAfter(uint32_t program_id);
  // What a person does at the teach pendant after a protective stop.
  void UnlockByHand();
  // Likewise: one line, and whatever the answer is.
  void SendToDashboard(const std::string& line);
  v1::SourceState State();
  // A person releases the stop.
  grpc::Status Reset();
  v1::RigState RigState();
  std::shared_ptr<v1::Control::Stub> control() { return control_; }

  // The journalled touches of session "test", oldest first. The gateway must be stopped.
  std::vector<session::JournalTouch> Journalled() const;
  // Every journalled result is of a touch that the emulator saw, at the pose that was commanded, and no two
  // are of the same one: nothing lost, doubled or at a wrong pose.
  void ExpectEveryResultIsItsOwnTouch();

  ManualClock lease_clock_;
  const TestFolder folder_;
  std::unique_ptr<rig::Emulator> emulator_;
  std::unique_ptr<service::GatewayServer> gateway_;
  std::shared_ptr<grpc::Channel> channel_;
  std::shared_ptr<v1::Source::Stub> source_;
  std::shared_ptr<v1::Control::Stub> control_;
  std::shared_ptr<v1::Rig::Stub> rig_;

 private:
  void Connect(int port);
  int ConnectToDashboard() const;
  pid_t process_ = 0;
};

}  // namespace touchstone
