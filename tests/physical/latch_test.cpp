// The latch that stops close: after a stop, a protective or emergency stop, or a gateway that fell silent, nothing
// moves, whatever retries, until a person resets it.
#include <gmock/gmock.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>

#include <filesystem>
#include <fstream>
#include <random>

#include "server/base/test_tier.h"
#include "tests/physical/latch_fixture.h"

extern char** environ;

namespace touchstone {
namespace {

using testing::AllOf;
using testing::AnyOf;
using testing::Each;
using testing::HasSubstr;

// A program and its children, ended with the object.
class ProcessGroup {
 public:
  explicit ProcessGroup(std::vector<std::string> words) {
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    EXPECT_EQ(posix_spawnp(&pid_, argv[0], nullptr, &attributes, argv.data(), environ), 0) << argv[0];
    posix_spawnattr_destroy(&attributes);
  }
  ~ProcessGroup() {
    if (!Ended()) kill(-pid_, SIGKILL), waitpid(pid_, nullptr, 0);
  }
  bool Ended() {
    if (!ended_) ended_ = waitpid(pid_, &status_, WNOHANG) == pid_;
    return ended_;
  }
  int exit_code() const { return WIFEXITED(status_) ? WEXITSTATUS(status_) : -1; }

 private:
  pid_t pid_ = 0;
  int status_ = 0;
  bool ended_ = false;
};

TEST_F(Latch, AShellLoopAroundTheCommandMovesNothingAfterAStop) {
  StartRig();
  StartGateway();
  const std::string plan = folder_.Path("plan.csv"), tries = folder_.Path("tries");
  std::ofstream(plan) << "touch,object,speed_mm_s,standoff_mm,target_x_mm,target_y_mm,target_z_mm,approach_x,"
                         "approach_y,approach_z,lateral_x,lateral_y,lateral_z\n"
                         "0,lat00,1.25,50,0,0,70,0,0,-1,1,0,0\n1,lat00,20,50,10,0,70,0,0,-1,1,0,0\n";
  ProcessGroup loop(
      {"sh", "-c",
       "while ! \"$1\" rig run \"$2\" -o \"$3\" --session test --server \"$4\" -q 2>>\"$5\"; do "
       "echo retry >>\"$5\"; sleep .2; done",
       "loop", Touchstone(), plan, folder_.Path("run.db"), "127.0.0.1:" + std::to_string(gateway_->port()),
       tries});
  const auto retries = [&] {
    std::ifstream file(tries);
    const std::string text((std::istreambuf_iterator<char>(file)), {});
    int count = 0;
    for (size_t at = text.find("retry\n"); at != std::string::npos; at = text.find("retry\n", at + 1))
      ++count;
    return count;
  };
  WaitUntilApproaching();
  EXPECT_THAT(Whole().lease_holder(), testing::MatchesRegex("[^ ]+@[^ ]+ rig-run [0-9]+"));
  Stop("cable caught");
  const size_t commands = CommandCount();
  WaitForRest();
  const int before = retries();
  WaitUntil([&] { return retries() >= before + 5; }, "the loop tries again and again");
  EXPECT_THAT(CommandsSince(commands), Each("program stop_motion")) << "the loop moved the arm after a stop";
  EXPECT_EQ(State(), v1::SOURCE_STATE_STOPPED);
  EXPECT_THAT(StopReason(), HasSubstr("cable caught"));
  EXPECT_FALSE(loop.Ended());

  // A person releases it, and the same loop finishes the plan.
  EXPECT_TRUE(Reset().ok());
  WaitUntil([&] { return loop.Ended(); }, "the loop has come to its end");
  ExpectEveryResultIsItsOwnTouch();
  EXPECT_EQ(Journalled().size(), 2u);
}

TEST_F(Latch, AProtectiveStopDuringAMotionHoldsUntilAReset) {
  StartRig();
  StartGateway();
  {
    KeptLease lease(control_.get(), "client", true);
    auto touch = TouchLater(lease.token(), FromAbove(kSlow), "stopped");
    WaitUntilApproaching();
    emulator_->faults().Set("protective_stop", 1);
    EXPECT_EQ(touch.get().status.error_code(), grpc::FAILED_PRECONDITION);
  }
  ExpectNothingMovesUntilReset("PROTECTIVE_STOP during program");
  EXPECT_EQ(State(), v1::SOURCE_STATE_PROTECTIVE_STOP);
  EXPECT_EQ(Reset().error_code(), grpc::FAILED_PRECONDITION) << "unlocked at the pendant first";
  UnlockByHand();
  EXPECT_EQ(State(), v1::SOURCE_STATE_STOPPED);
  ExpectNothingMovesUntilReset("PROTECTIVE_STOP during program");
  EXPECT_TRUE(Reset().ok());
  EXPECT_EQ(StopReason(), "");
  ExpectTheTouchCanBeMade(FromAbove(kSlow), "stopped");
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(Latch, AnEmergencyStopBetweenMotionsHoldsOverPowerOnAndARestart) {
  StartRig();
  StartGatewayProcess();
  emulator_->faults().Set("emergency_stop", 1);
  WaitUntil([&] { return StopReason() != ""; }, "the emergency stop latches");
  EXPECT_THAT(StopReason(), HasSubstr("ROBOT_EMERGENCY_STOP between motions"));
  emulator_->faults().Set("emergency_stop", 0);
  WaitUntil([&] { return State() == v1::SOURCE_STATE_STOPPED; }, "the emergency stop is released");
  ExpectNothingMovesUntilReset("ROBOT_EMERGENCY_STOP");
  KillGatewayProcess();
  StartGatewayProcess();
  EXPECT_EQ(State(), v1::SOURCE_STATE_STOPPED);
  ExpectNothingMovesUntilReset("ROBOT_EMERGENCY_STOP");
  EXPECT_EQ(RigState().arm().robot_mode(), v1::ROBOT_MODE_POWER_OFF) << "a retry powered the arm on";
  EXPECT_TRUE(Reset().ok());
  {
    KeptLease lease(control_.get(), "a person", true);
    EXPECT_TRUE(PowerOn(lease.token()).ok());
  }
  ExpectTheTouchCanBeMade(FromAbove(), "afterwards");
  KillGatewayProcess();
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(Latch, AProtectiveStopThatIsFoundAtTheStartHoldsToo) {
  StartRig();
  emulator_->faults().Set("protective_stop", 1);
  WaitUntil([&] { return emulator_->controller().Count("protective_stops") == 1; }, "it stops protectively");
  StartGateway();
  WaitUntil([&] { return StopReason() != ""; }, "the protective stop latches");
  EXPECT_THAT(StopReason(), HasSubstr("PROTECTIVE_STOP found when the arm was reached"));
  UnlockByHand();
  ExpectNothingMovesUntilReset("PROTECTIVE_STOP");
  EXPECT_TRUE(Reset().ok());
  ExpectTheTouchCanBeMade(FromAbove(), "afterwards");
}

// --- A gateway that fell silent. What the controller's watchdog does then (it ends the program, or stops the arm
// protectively) makes no difference to any of this.

TEST_F(Latch, AKilledGatewaysSuccessorSaysWhatItFoundAndWaitsForAPerson) {
  StartRig();
  StartGatewayProcess();
  {
    KeptLease lease(control_.get(), "before", true);
    auto touch = TouchLater(lease.token(), FromAbove(0.0005), "killed");
    WaitUntilApproaching();
    KillGatewayProcess();
    EXPECT_FALSE(touch.get().status.ok());
  }
  WaitUntil([&] { return emulator_->controller().Count("watchdog_stops") > 0; }, "the watchdog notices");
  WaitForRest();
  StartGatewayProcess();
  EXPECT_EQ(RigState().interrupted_touches(), 1u);
  EXPECT_THAT(StopReason(),
              AllOf(HasSubstr("touch 'killed' of session 'test'"), HasSubstr("phase 'approach'"),
                    HasSubstr("safety mode"), HasSubstr("the tip stands at")));
  if (State() == v1::SOURCE_STATE_PROTECTIVE_STOP) UnlockByHand();
  EXPECT_EQ(State(), v1::SOURCE_STATE_STOPPED);
  ExpectNothingMovesUntilReset("touch 'killed' of session 'test'");
  EXPECT_TRUE(Reset().ok());
  ExpectTheTouchCanBeMade(FromAbove(0.0005), "killed");
  KillGatewayProcess();
  // What was said once is not found again.
  StartGatewayProcess();
  EXPECT_EQ(State(), v1::SOURCE_STATE_IDLE) << StopReason();
  KillGatewayProcess();
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(Latch, AGatewayThatHungFindsItsProgramEndedAndWaitsForAPerson) {
  StartRig();
  StartGatewayProcess();
  // Shortly, and for longer than a lease lasts.
  for (const double hung_s : {0.0, 2.5}) {
    const uint64_t watchdog_stops = emulator_->controller().Count("watchdog_stops");
    const uint32_t before = RigState().arm().program_id();
    KeptLease lease(control_.get(), "before", true);
    auto touch = TouchLater(lease.token(), FromAbove(0.0005), "hung");
    WaitUntilApproachingAfter(before);
    ASSERT_EQ(kill(gateway_process(), SIGSTOP), 0);
    const auto since = std::chrono::steady_clock::now();
    WaitUntil([&] { return emulator_->controller().Count("watchdog_stops") > watchdog_stops; },
              "the watchdog notices");
    WaitUntil(
        [&] { return std::chrono::steady_clock::now() > since + std::chrono::duration<double>(hung_s); },
        "it hangs so long");
    WaitForRest();
    const size_t commands = CommandCount();
    ASSERT_EQ(kill(gateway_process(), SIGCONT), 0);
    EXPECT_FALSE(touch.get().status.ok());
    WaitUntil([&] { return !StopReason().empty(); }, "the gateway latches");
    EXPECT_THAT(CommandsSince(commands), Each("program stop_motion"));
    if (State() == v1::SOURCE_STATE_PROTECTIVE_STOP) UnlockByHand();
    ExpectNothingMovesUntilReset("");
    EXPECT_FALSE(emulator_->controller().Moving());
    EXPECT_TRUE(Reset().ok());
  }
  KillGatewayProcess();
}

// --- Stops while the arm is powered up, goes and touches

TEST_F(Latch, NothingThatCouldMoveTheArmIsSentAfterAStopAtAnyMoment) {
  StartRig([](rig::EmulatorOptions* options) { options->powered = false; });
  StartGateway();
  double whole_s = 0;
  {
    KeptLease lease(control_.get(), "client", true);
    const auto began = std::chrono::steady_clock::now();
    ASSERT_TRUE(PowerOn(lease.token()).ok());
    const Answer touch = Touch(lease.token(), FromAbove(QuickMS()), "whole");
    ASSERT_TRUE(touch.status.ok()) << touch.status.error_message();
    whole_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  }
  std::mt19937 random(20261122);
  std::uniform_real_distribution<double> moment(0, whole_s);
  int while_powering = 0;
  // At least so many; how long powering up takes depends on what else the machine does. The rest is of the second tier.
  const int tries = SecondTierRuns() ? 40 : 12, while_powering_wanted = SecondTierRuns() ? 4 : 2;
  for (int k = 0; k < tries || (while_powering < while_powering_wanted && k < 400); ++k) {
    // A person switches the arm off; if it was on, that latches.
    const bool ran_before = RigState().arm().robot_mode() == v1::ROBOT_MODE_RUNNING;
    SendToDashboard("power off\n");
    WaitUntil([&] { return RigState().arm().robot_mode() == v1::ROBOT_MODE_POWER_OFF; }, "the arm is off");
    WaitUntil([&] { return !ran_before || !StopReason().empty(); }, "it latches");
    ASSERT_TRUE(Reset().ok());
    KeptLease lease(control_.get(), "client", true);
    auto touch = std::async(std::launch::async, [&, k] {
      PowerOn(lease.token());
      return Touch(lease.token(), FromAbove(QuickMS(), 1), "stopped " + std::to_string(k));
    });
    // Powering up comes first: every second stop is an early one.
    std::this_thread::sleep_for(std::chrono::duration<double>(moment(random) * (k % 2 == 0 ? 1 : 0.3)));
    Stop("at any moment");
    const size_t commands = CommandCount();
    const bool ran = RigState().arm().robot_mode() == v1::ROBOT_MODE_RUNNING;
    touch.get();
    WaitForRest();
    WaitForRigTime(5);  // longer than any step of powering up
    EXPECT_THAT(CommandsSince(commands), Each(AnyOf("program stop_motion", "power off"))) << "try " << k;
    EXPECT_FALSE(emulator_->controller().Moving()) << "try " << k;
    if (!ran) {
      ++while_powering;
      EXPECT_NE(RigState().arm().robot_mode(), v1::ROBOT_MODE_RUNNING)
          << "try " << k << ": the brakes were released after the stop";
    }
    ASSERT_TRUE(Reset().ok());
  }
  EXPECT_GE(while_powering, while_powering_wanted) << "too few stops came while the arm was powered up";
  ExpectEveryResultIsItsOwnTouch();
}

TEST_F(Latch, EveryCommandThatRepeatsMotionsEndsWithAStop) {
  StartRig();
  StartGateway();
  const std::vector<std::vector<std::string>> commands = {
      {"calibrate", "flat", "lat00", "--touches", "20", "-o", folder_.Path("model.yaml")},
      {"calibrate", "object", "lat00", "--calibration", emulator_->calibration_path(), "-o",
       folder_.Path("new.yaml")},
      {"photos", "lat00", "-o", folder_.Path("photos")}};
  for (const std::vector<std::string>& command : commands) {
    std::vector<std::string> words = {Touchstone(), "rig"};
    words.insert(words.end(), command.begin(), command.end());
    words.insert(words.end(), {"-q", "--server", "127.0.0.1:" + std::to_string(gateway_->port())});
    ProcessGroup process(words);
    WaitUntil([&] { return emulator_->controller().Moving() || process.Ended(); }, "the arm moves");
    ASSERT_FALSE(process.Ended()) << command[0] << " " << command[1];
    Stop("in the middle of it");
    const size_t sent = CommandCount();
    WaitUntil([&] { return process.Ended(); }, "the command ends");
    WaitForRest();
    EXPECT_NE(process.exit_code(), 0);
    EXPECT_THAT(CommandsSince(sent), Each("program stop_motion")) << command[0] << " " << command[1];
    ASSERT_TRUE(Reset().ok());
  }
}

// --- The serial line

TEST_F(Latch, LostFramesOnTheSerialLineTripNoWatchdogAndFailNoTouch) {
  // A frame that is lost costs as long as the watchdog's period, as it once did in a rig with usual settings: the
  // heartbeats do not wait for the end effector.
  StartRig();
  StartGateway({"--effector-reply-timeout-s", "1"});
  emulator_->faults().Set("drop_bytes", 0.005);
  KeptLease lease(control_.get(), "client", true);
  const int touches = SecondTierRuns() ? 20 : 8;  // long: a second for every frame that is lost
  for (int k = 0; k < touches; ++k) {
    const Answer answer = Touch(lease.token(), FromAbove(QuickMS(), k % 5 - 2), "touch " + std::to_string(k));
    EXPECT_TRUE(answer.status.ok()) << k << ": " << answer.status.error_message();
  }
  EXPECT_GT(RigState().effector().bad_frames(), 0u) << "the line was good";
  EXPECT_EQ(emulator_->controller().Count("watchdog_stops"), 0u);
  EXPECT_EQ(emulator_->controller().Count("protective_stops"), 0u);
  emulator_->faults().Set("drop_bytes", 0);
  ExpectEveryResultIsItsOwnTouch();
}

// --- Who

TEST_F(Latch, TwoProgramsOfOnePersonAreToldApartInRefusalsStateStopAndLog) {
  StartRig();
  StartGateway();
  {
    KeptLease first(control_.get(), "ana@lab rig-run 4711", false);
    KeptLease second(control_.get(), "ana@lab train.py 4712", false);
    EXPECT_EQ(second.status().error_code(), grpc::FAILED_PRECONDITION);
    EXPECT_THAT(second.status().error_message(), HasSubstr("ana@lab rig-run 4711"));
    EXPECT_EQ(Whole().lease_holder(), "ana@lab rig-run 4711");
    KeptLease third(control_.get(), "ana@lab train.py 4712", true);
    EXPECT_THAT(Touch(first.token(), FromAbove(), "stale").status.error_message(),
                HasSubstr("ana@lab train.py 4712"));
  }
  v1::StopRequest request;
  request.set_reason("cable caught");
  request.set_holder("ana@lab rig-stop 4713" + std::string(1000, '!'));
  v1::StopResponse response;
  grpc::ClientContext context;
  ASSERT_TRUE(control_->Stop(&context, request, &response).ok()) << "a stop is never refused";
  EXPECT_THAT(StopReason(), AllOf(HasSubstr("by ana@lab rig-stop 4713"), HasSubstr("cable caught")));
  std::ifstream audit(folder_.Path("rig/audit.jsonl"));
  const std::string log((std::istreambuf_iterator<char>(audit)), {});
  EXPECT_THAT(log,
              AllOf(HasSubstr("\"taken_from\":\"ana@lab rig-run 4711\""),
                    HasSubstr("\"holder\":\"ana@lab train.py 4712\""), HasSubstr("ana@lab rig-stop 4713")));
}

}  // namespace
}  // namespace touchstone
