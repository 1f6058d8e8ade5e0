#include "tests/physical/physical_test.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "server/session/journal/command_bytes.h"

extern char** environ;

namespace touchstone {

namespace {

// Limits that a busy machine, or one under sanitizers, keeps too; that of the lease is host time (of a gateway in another
// process), the others the rig's clock over its speed-up. A rig has shorter ones.
const std::vector<std::string>& Patience() {
  static const std::vector<std::string> flags = {"--lease-window-s", "2",   "--arm-watchdog-hz",    "1",
                                                 "--arm-silence-s",  "1.5", "--effector-silence-s", "3"};
  return flags;
}

}  // namespace

KeptLease::KeptLease(v1::Control::Stub* control, const std::string& holder, bool take) : control_(control) {
  v1::AcquireLeaseRequest request;
  request.set_holder(holder);
  request.set_take(take);
  grpc::ClientContext context;
  status_ = control_->AcquireLease(&context, request, &lease_);
  if (!status_.ok()) return;
  keeper_ = std::thread([this] {
    v1::RenewLeaseRequest renew;
    renew.set_token(lease_.token());
    while (!ending_) {
      v1::Lease renewed;
      grpc::ClientContext renewing;
      if (!control_->RenewLease(&renewing, renew, &renewed).ok()) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
  });
}

KeptLease::~KeptLease() {
  StopRenewing();
  if (!status_.ok()) return;
  v1::ReleaseLeaseRequest request;
  request.set_token(lease_.token());
  v1::ReleaseLeaseResponse response;
  grpc::ClientContext context;
  control_->ReleaseLease(&context, request, &response);
}

void KeptLease::StopRenewing() {
  ending_ = true;
  if (keeper_.joinable()) keeper_.join();
}

PhysicalTest::~PhysicalTest() {
  StopGateway();
  if (process_ > 0) KillGatewayProcess();
  emulator_ = nullptr;
}

bool PhysicalTest::Cb3() {
  const char* arm = std::getenv("TOUCHSTONE_TEST_ARM");
  return arm != nullptr && std::string(arm) == "ur3";
}

void PhysicalTest::StartRig(const std::function<void(rig::EmulatorOptions*)>& change) {
  rig::EmulatorOptions options;
  options.dir = folder_.Path("rig");
  options.speedup = 40;
  options.supershape_triangles = 2000;
  options.powered = true;
  if (Cb3()) options.arm = "ur3";
  if (change) change(&options);
  emulator_ = rig::Emulator::Start(options);
}

void PhysicalTest::StartGateway(std::vector<std::string> flags) {
  flags.insert(flags.begin(), {"touchstone-gateway", "--config", emulator_->config_path(), "--listen",
                               "127.0.0.1:0", "--supershape-triangles", "2000"});
  flags.insert(flags.begin() + 1, Patience().begin(), Patience().end());
  std::vector<const char*> argv;
  for (const std::string& flag : flags) argv.push_back(flag.c_str());
  auto parsed = service::ParseGatewayFlags(static_cast<int>(argv.size()), argv.data());
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  parsed->options.common.clock = &lease_clock_;
  parsed->options.common.max_unary_calls_per_s = 0;  // calls are counted by it, too
  auto gateway = service::GatewayServer::Start(parsed->options);
  ASSERT_TRUE(gateway.ok()) << gateway.status();
  gateway_ = *std::move(gateway);
  Connect(gateway_->port());
}

void PhysicalTest::StopGateway() {
  gateway_ = nullptr;
}

void PhysicalTest::StartGatewayProcess() {
  const std::string program =
      std::filesystem::read_symlink("/proc/self/exe").parent_path() / "touchstone-gateway";
  const std::string out = folder_.Path("gateway.out");
  std::filesystem::remove(out);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, 1, out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  std::vector<std::string> words = {program,    "--config",    emulator_->config_path(),
                                    "--listen", "127.0.0.1:0", "--supershape-triangles",
                                    "2000"};
  words.insert(words.begin() + 1, Patience().begin(), Patience().end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  ASSERT_EQ(posix_spawn(&process_, program.c_str(), &files, nullptr, argv.data(), environ), 0);
  posix_spawn_file_actions_destroy(&files);
  int port = 0;
  WaitUntil(
      [&] {
        std::ifstream file(out);
        std::string line;
        if (!std::getline(file, line) || line.rfind("listening on ", 0) != 0 || file.eof()) return false;
        port = std::stoi(line.substr(line.rfind(':') + 1));
        return true;
      },
      "touchstone-gateway listens");
  Connect(port);
}

void PhysicalTest::KillGatewayProcess() {
  kill(process_, SIGKILL);
  waitpid(process_, nullptr, 0);
  process_ = 0;
}

void PhysicalTest::AwaitGatewayProcess() {
  waitpid(process_, nullptr, 0);
  process_ = 0;
}

void PhysicalTest::Connect(int port) {
  channel_ = grpc::CreateChannel("127.0.0.1:" + std::to_string(port), grpc::InsecureChannelCredentials());
  source_ = v1::Source::NewStub(channel_);
  control_ = v1::Control::NewStub(channel_);
  rig_ = v1::Rig::NewStub(channel_);
  // The rig is there once arm and end effector answer.
  WaitUntil(
      [this] {
        v1::RigState state;
        grpc::ClientContext context;
        return rig_->GetRig(&context, {}, &state).ok() && state.arm().connected() &&
               state.effector().connected();
      },
      "the rig is ready");
}

v1::CommandedTouch PhysicalTest::FromAbove(double speed_m_s, double which) const {
  v1::CommandedTouch touch;
  touch.mutable_target_m()->set_x(0.01 * which);
  touch.mutable_target_m()->set_y(0);
  touch.mutable_target_m()->set_z(0.07);
  touch.mutable_approach()->set_z(-1);
  touch.mutable_lateral()->set_x(1);
  touch.set_standoff_m(0.05);
  touch.set_speed_m_s(speed_m_s);
  return touch;
}

PhysicalTest::Answer PhysicalTest::Touch(const std::string& token, const v1::CommandedTouch& touch,
                                         const std::string& id, const std::string& object) {
  v1::TouchRequest request;
  request.set_object(object);
  *request.add_touches() = touch;
  request.set_lease_token(token);
  request.set_session("test");
  request.add_touch_ids(id);
  Answer answer;
  grpc::ClientContext context;
  answer.status = source_->Touch(&context, request, &answer.response);
  return answer;
}

std::future<PhysicalTest::Answer> PhysicalTest::TouchLater(const std::string& token,
                                                           const v1::CommandedTouch& touch,
                                                           const std::string& id) {
  return std::async(std::launch::async, [=] { return Touch(token, touch, id); });
}

void PhysicalTest::WaitUntil(const std::function<bool()>& done, const char* what) {
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!done()) {
    ASSERT_LT(std::chrono::steady_clock::now(), until) << what << ": not within a minute";
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

void PhysicalTest::WaitUntilApproaching() {
  WaitUntil([this] { return RigState().arm().phase() == v1::MOTION_PHASE_APPROACH; }, "the arm approaches");
}

void PhysicalTest::WaitUntilApproachingAfter(uint32_t program_id) {
  WaitUntil([&] { return RigState().arm().program_id() != program_id; }, "another program begins");
  WaitUntilApproaching();
}

void PhysicalTest::SendToDashboard(const std::string& line) {
  const int fd = ConnectToDashboard();
  EXPECT_EQ(send(fd, line.data(), line.size(), MSG_NOSIGNAL), static_cast<ssize_t>(line.size()));
  // Both the banner and the answer, or the line may be lost with the connection.
  std::string text;
  for (char c; std::count(text.begin(), text.end(), '\n') < 2 && recv(fd, &c, 1, 0) == 1;) text += c;
  close(fd);
}

int PhysicalTest::ConnectToDashboard() const {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(emulator_->controller().ports().dashboard));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  return fd;
}

void PhysicalTest::UnlockByHand() {
  const int fd = ConnectToDashboard();
  const std::string line = "unlock protective stop\n";
  WaitUntil(
      [&] {
        EXPECT_EQ(send(fd, line.data(), line.size(), MSG_NOSIGNAL), static_cast<ssize_t>(line.size()));
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        return State() != v1::SOURCE_STATE_PROTECTIVE_STOP;
      },
      "the protective stop is unlocked by hand");
  close(fd);
}

v1::SourceState PhysicalTest::State() {
  v1::State state;
  grpc::ClientContext context;
  return control_->GetState(&context, {}, &state).ok() ? state.state() : v1::SOURCE_STATE_DISCONNECTED;
}

grpc::Status PhysicalTest::Reset() {
  v1::ResetRequest request;
  request.set_holder("a person");
  request.set_reason("a test");
  v1::State state;
  grpc::ClientContext context;
  return control_->Reset(&context, request, &state);
}

v1::RigState PhysicalTest::RigState() {
  v1::RigState state;
  grpc::ClientContext context;
  const grpc::Status status = rig_->GetRig(&context, {}, &state);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return state;
}

std::vector<session::JournalTouch> PhysicalTest::Journalled() const {
  std::vector<session::JournalTouch> touches;
  const auto journal = session::Journal::Open(folder_.Path("rig/rig.db"), session::Journal::Mode::kReadOnly);
  EXPECT_TRUE(journal.ok()) << journal.status();
  if (!journal.ok()) return touches;
  const absl::Status read = (*journal)->ForEachTouch("test", [&](const session::JournalTouch& touch) {
    touches.push_back(touch);
    return true;
  });
  EXPECT_TRUE(read.ok()) << read;
  return touches;
}

void PhysicalTest::ExpectEveryResultIsItsOwnTouch() {
  StopGateway();
  const std::vector<rig::TouchTruth> truths = emulator_->Touches();
  std::vector<bool> taken(truths.size(), false);
  for (const session::JournalTouch& touch : Journalled()) {
    EXPECT_TRUE(touch.stage == session::TouchStage::kDone || touch.stage == session::TouchStage::kFailed)
        << touch.id << " was neither done nor given up";
    if (touch.stage != session::TouchStage::kDone) continue;
    const auto command = session::ParseCommandBytes(touch.command);
    ASSERT_TRUE(command.has_value());
    bool found = false;
    for (size_t k = 0; k < truths.size() && !found; ++k) {
      const rig::TouchTruth& truth = truths[k];
      if (taken[k] || truth.object != touch.object) continue;
      // The same start: target - standoff * approach.
      const Eigen::Vector3d start(command->target_m().x() - command->standoff_m() * command->approach().x(),
                                  command->target_m().y() - command->standoff_m() * command->approach().y(),
                                  command->target_m().z() - command->standoff_m() * command->approach().z());
      if ((start - truth.start_in_object_m).norm() > 1e-4) continue;
      // The same differences between its fingers.
      double furthest_s = 0;
      for (size_t i = 0; i < touch.result.fingers.size(); ++i) {
        const double measured_s =
            touch.result.fingers[i].contact_time_s - touch.result.fingers[0].contact_time_s;
        const double true_s = truth.reported_s[i] - truth.reported_s[0];
        if (std::isnan(measured_s) != std::isnan(true_s)) furthest_s = INFINITY;
        if (!std::isnan(true_s)) furthest_s = std::max(furthest_s, std::abs(measured_s - true_s));
      }
      if (furthest_s < 2e-3) taken[k] = found = true;
    }
    EXPECT_TRUE(found) << touch.id << ": no emulated touch of its own has its pose and times";
  }
}

}  // namespace touchstone
