#include "tests/rig/controller.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <ctime>
#include <limits>
#include <list>
#include <mutex>
#include <stdexcept>
#include <thread>

#include "tests/rig/controller/machine/machine.h"
#include "tests/rig/controller/network/net.h"
#include "tests/rig/controller/protocol/client.h"
#include "tests/rig/controller/protocol/dashboard.h"
#include "tests/rig/controller/protocol/primary_packets.h"
#include "tests/rig/controller/protocol/realtime_packet.h"

namespace touchstone::rig {
namespace {

constexpr double kStateEveryS = 0.1;  // primary and secondary, host time
constexpr double kMinCycleS = 0.001;  // of the control loop, host time
constexpr double kMaxIdleS = 0.002;   // between two looks at the faults, host time
constexpr double kLookAgainS = 2e-4;  // whether clients have read, host time
constexpr size_t kMaxConnections = 64, kMaxLine = 65536, kMaxCommands = 10'000;
constexpr double kRoundingS = 1e-9;  // of the times of cycles
constexpr int kMaxLateData = 50;     // packages that a late host makes up for

// One thread serves the sockets and moves the arm.
class EmulatedController : public Controller {
 public:
  EmulatedController(const ControllerOptions& options, SimClock* clock, Faults* faults, TipListener* tip)
      : options_(options),
        clock_(clock),
        faults_(faults),
        machine_(options, faults, tip),
        random_(options.seed + 1) {
    const int wanted[kPorts] = {options.dashboard_port,
                                options.primary_port,
                                options.secondary_port,
                                options.realtime_port,
                                options.rtde_port,
                                options.primary_read_only_port,
                                options.secondary_read_only_port,
                                options.realtime_read_only_port};
    int bound[kPorts] = {};
    std::fill(std::begin(listeners_), std::end(listeners_), -1);
    try {
      for (int port = 0; port < kPorts; ++port)
        listeners_[port] = Listen(options.address, wanted[port], &bound[port]);
      wake_ = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
      if (wake_ < 0) throw std::runtime_error("emulated controller: no descriptor is left for its events");
    } catch (...) {
      CloseListeners();
      throw;
    }
    ports_ = {
        bound[kDashboard], bound[kPrimary],         bound[kSecondary],         bound[kRealtime],
        bound[kRtde],      bound[kPrimaryReadOnly], bound[kSecondaryReadOnly], bound[kRealtimeReadOnly]};
    part_ = std::make_unique<SimClock::Part>(clock, [this] { Wake(); });
    thread_ = std::thread([this] { Loop(); });
  }

  ~EmulatedController() override {
    stop_ = true;
    Wake();
    thread_.join();
    part_.reset();
    clients_.clear();
    CloseListeners();
  }

  Ports ports() const override { return ports_; }

  Eigen::Isometry3d BaseFromTip() const override {
    std::lock_guard<std::recursive_mutex> lock(mutex_);
    return machine_.ActualFlangeAt(clock_->NowS()) * machine_.flange_from_tip();
  }
  Eigen::Isometry3d BaseFromFlange() const override {
    std::lock_guard<std::recursive_mutex> lock(mutex_);
    return machine_.ActualFlangeAt(clock_->NowS());
  }
  std::string MoveByHand(const std::array<double, 6>& joints_rad) override {
    std::lock_guard<std::recursive_mutex> lock(mutex_);
    return machine_.MoveByHand(Joints(joints_rad.data()))
               ? ""
               : "the arm is not free: its brakes hold against the hand";
  }
  bool Free() const override {
    std::lock_guard<std::recursive_mutex> lock(mutex_);
    return machine_.free();
  }
  bool ProgramRuns() const override {
    std::lock_guard<std::recursive_mutex> lock(mutex_);
    return machine_.has_program();
  }
  bool Moving() const override {
    std::lock_guard<std::recursive_mutex> lock(mutex_);
    return machine_.Moving();
  }
  uint64_t Count(const std::string& what) const override {
    std::lock_guard<std::recursive_mutex> lock(mutex_);
    return machine_.Count(what);
  }
  std::vector<std::string> Commands() const override {
    std::lock_guard<std::recursive_mutex> lock(mutex_);
    return commands_;
  }

 private:
  void Wake() {
    const uint64_t one = 1;
    if (write(wake_, &one, sizeof one) < 0) return;  // already awake
  }

  void Take(const std::string& command) {
    if (commands_.size() < kMaxCommands) commands_.push_back(command);
  }

  // "move" of "def move():..."
  static std::string NameOf(const std::string& program) {
    const size_t space = program.find(' '), parenthesis = program.find('(');
    return space < parenthesis && parenthesis != std::string::npos
               ? program.substr(space + 1, parenthesis - space - 1)
               : "?";
  }

  void CloseListeners() {
    for (int& fd : listeners_)
      if (fd >= 0) close(fd);
    if (wake_ >= 0) close(wake_);
  }

  void Loop() {
    // Linux lets sleepers wake 50 us late to save power; controllers run a real-time kernel, which does not.
    prctl(PR_SET_TIMERSLACK, 1000, 0, 0, 0);
    while (!stop_) {
      std::vector<pollfd> polled = Polled();
      const double wait_s = std::clamp(NextWakeHostS() - clock_->HostS(), clock_->Stands() ? kLookAgainS : 0,
                                       readers_behind_ ? kLookAgainS : kMaxIdleS);
      const timespec timeout{0, static_cast<long>(wait_s * 1e9)};
      ppoll(polled.data(), polled.size(), &timeout, nullptr);
      if (uint64_t count; polled[0].revents != 0 && read(wake_, &count, sizeof count) < 0) continue;
      std::lock_guard<std::recursive_mutex> lock(mutex_);
      const double now_s = clock_->NowS();
      Turn(now_s);
      readers_behind_ = ReadersAreBehind();
      if (!readers_behind_) part_->Done(now_s);
    }
  }

  // A manual clock is moved by who reads.
  bool ReadersAreBehind() {
    bool behind = false;
    for (Client& client : clients_) behind |= !clock_->manual() && client.HasToRead();
    return behind;
  }

  std::vector<pollfd> Polled() const {
    std::vector<pollfd> polled = {{wake_, POLLIN, 0}};
    const bool room = clients_.size() < kMaxConnections;
    for (const int fd : listeners_)
      if (room) polled.push_back({fd, POLLIN, 0});
    if (frozen_ || cut_off_) return polled;
    for (const Client& client : clients_)
      polled.push_back({client.connection.fd(),
                        static_cast<short>(POLLIN | (client.connection.Blocked() ? POLLOUT : 0)), 0});
    return polled;
  }

  double NextWakeHostS() const {
    const double host_s = clock_->HostS(), sim_s = clock_->NowS();
    double next = host_s + kMaxIdleS;
    if (frozen_) return std::min(next, faults_ ? faults_->UntilHostS("freeze") : next);
    next = std::min(next, next_state_s_);
    next = std::min(next, host_s + (machine_.NextEventS() - sim_s) / clock_->speedup());
    if (machine_.NeedsCycles()) {
      next = std::min(
          next, std::max(last_turn_s_ + kMinCycleS, host_s + CycleBoundaryIn(sim_s) / clock_->speedup()));
      // An input that a program may be waiting for is seen at the very next cycle.
      if (input_came_ && clock_->speedup() > 1)
        next = std::min(next, host_s + (machine_.NextCycleS() - sim_s) / clock_->speedup());
    }
    for (const Client& client : clients_) {
      if (cut_off_) break;
      if (client.WantsData())
        next = std::min(next, host_s + (client.next_data_s - sim_s) / clock_->speedup());
      next = std::min(next, client.connection.NextReleaseS());
    }
    return next;
  }

  double CycleBoundaryIn(double sim_s) const {
    return (std::floor(sim_s / machine_.cycle_s()) + 1) * machine_.cycle_s() - sim_s;
  }

  void Turn(double now_s) {
    last_turn_s_ = clock_->HostS();
    Accept();
    const bool freeze = faults_ && faults_->UntilHostS("freeze") > 0;
    if (freeze && !frozen_) machine_.Freeze(now_s);
    if (!freeze && frozen_) machine_.Thaw(now_s);
    frozen_ = freeze;
    if (faults_ && faults_->Take("disconnect") != 0) clients_.clear();
    const bool dark = faults_ && faults_->UntilHostS("power_cut") > 0;
    if (dark && !dark_) machine_.LosePower();
    if (!dark && dark_) machine_.Boot(now_s);
    dark_ = dark;
    if (dark_) clients_.clear();
    cut_off_ = faults_ && faults_->UntilHostS("network") > 0;
    if (frozen_ || dark_) return;

    // What was due before now comes first; then what clients have sent; watchdogs last.
    const auto changed = [this] {
      if (clock_->speedup() > 1) SendData(true);
    };
    if (cut_off_) {  // the controller goes on; what was sent to it, and what it has to say, waits
      machine_.Advance(now_s, nullptr);
      machine_.CheckWatchdogs(nullptr);
      return;
    }
    SendDueData(now_s, changed);
    machine_.Advance(now_s, changed);
    input_came_ = false;
    for (Client& client : clients_) Receive(&client);
    machine_.Advance(machine_.now_s(), changed);
    machine_.CheckWatchdogs(changed);
    for (const Announcement& announcement : machine_.TakeAnnouncements()) {
      const std::string packet = AnnouncementPacket(announcement, machine_.now_s());
      for (Client& client : clients_)
        if (client.GetsMessages()) client.connection.Send(packet);
    }
    SendStates();
    const double host_s = clock_->HostS();
    for (auto client = clients_.begin(); client != clients_.end();) {
      client->connection.Flush(host_s);
      client = client->connection.open() ? std::next(client) : clients_.erase(client);
    }
  }

  void Accept() {
    for (int port = 0; port < kPorts; ++port) {
      while (clients_.size() < kMaxConnections) {
        const int fd = accept4(listeners_[port], nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
        if (fd < 0) break;
        if (dark_) {
          close(fd);
          continue;
        }
        Client& client = clients_.emplace_back(static_cast<Port>(port), fd, machine_.LocalControl());
        client.next_data_s = machine_.now_s() + CycleBoundaryIn(machine_.now_s());
        if (port == kDashboard) client.connection.Send(std::string(kDashboardBanner) + "\n");
        if (port == kRtde) client.rtde = std::make_unique<RtdeSession>(&machine_, options_.model, &taken_);
        if (client.GetsStates()) {
          client.connection.Send(VersionPacket(options_.model));
          client.connection.Send(StatePacket(machine_.State(), machine_.geometry(), options_.model));
        }
      }
    }
  }

  void Receive(Client* client) {
    const size_t before = client->received.size();
    client->connection.Read(&client->received);
    if (client->received.size() == before) return;
    switch (client->port) {
      case kDashboard:
        return ReceiveDashboard(client);
      case kPrimary:
      case kSecondary:
      case kRealtime:
        for (const std::string& program : client->programs.Feed(std::exchange(client->received, {})))
          Take("program " + NameOf(program)), machine_.StartProgram(program);
        return;
      case kRtde: {
        const bool was_started = client->rtde->started();
        client->connection.Send(client->rtde->Receive(&client->received));
        input_came_ = true;
        if (!was_started && client->rtde->started())
          client->next_data_s = machine_.now_s() + CycleBoundaryIn(machine_.now_s());
        if (client->rtde->broken()) client->connection.CloseWhenSent();
        return;
      }
      default:  // a read-only port
        client->received.clear();
    }
  }

  void ReceiveDashboard(Client* client) {
    size_t end;
    while ((end = client->received.find('\n')) != std::string::npos) {
      const std::string line = client->received.substr(0, end);
      client->received.erase(0, end + 1);
      bool quit = false;
      for (const char* command : {"power on", "power off", "brake release", "unlock protective stop"})
        if (line.rfind(command, 0) == 0) Take(command);
      client->connection.Send(AnswerDashboard(line, options_.model, client->local, &machine_, &quit) + "\n");
      if (quit) {
        client->connection.CloseWhenSent();
        return;
      }
    }
    if (client->received.size() > kMaxLine) client->connection.Close();
  }

  // Every package that has become due by `now_s`, made at its own cycle, before anything that has come since is
  // read: as a controller sends them, whose clock waits for nobody. What is late by more than kMaxLateData is
  // skipped.
  void SendDueData(double now_s, const std::function<void()>& changed) {
    for (int count = 0;; ++count) {
      double due_s = std::numeric_limits<double>::infinity();
      for (const Client& client : clients_)
        if (client.WantsData()) due_s = std::min(due_s, client.next_data_s);
      if (due_s > now_s) return;
      const bool late = count >= kMaxLateData;
      machine_.Advance(late ? now_s : due_s + kRoundingS, changed);
      SendData(false);
      if (late) return;
    }
  }

  // `all`: to every client that wants data, beside its rate. A client that does not read gets the newest once it does.
  // No cycle is sent twice to anybody.
  void SendData(bool all) {
    const double host_s = clock_->HostS(), now_s = machine_.now_s();
    const double cycle_s = std::floor(now_s / machine_.cycle_s() + 1e-6) * machine_.cycle_s();
    std::optional<RobotState> state;
    for (Client& client : clients_) {
      if (!client.WantsData()) continue;
      if (!all) {
        if (client.next_data_s > now_s) continue;
        // The rate is one of host time: an accelerated rig sends no more packages than another.
        const double period_s = clock_->speedup() * client.DataPeriodS(machine_.cycle_s());
        client.next_data_s = machine_.CycleAtOrAfter(client.next_data_s + period_s);
        if (client.next_data_s <= now_s) client.next_data_s = machine_.CycleAtOrAfter(now_s + period_s);
      }
      if (cycle_s <= client.data_cycle_s) continue;
      client.data_cycle_s = cycle_s;
      if (client.connection.Busy()) continue;
      double release_s = 0;
      if (faults_) {
        std::uniform_real_distribution<double> uniform;
        if (uniform(random_) < faults_->Get("skip_packets")) continue;
        if (const double late_ms = faults_->Get("late_packets_ms"); late_ms > 0)
          release_s = host_s + uniform(random_) * late_ms * 1e-3;
      }
      if (!state) state = machine_.State();
      client.connection.Send(client.rtde ? client.rtde->Data(*state) : RealtimePacket(*state), release_s);
    }
  }

  void SendStates() {
    const double host_s = clock_->HostS();
    if (host_s < next_state_s_) return;
    next_state_s_ = std::max(next_state_s_ + kStateEveryS, host_s + kStateEveryS / 2);
    std::string packet;
    for (Client& client : clients_) {
      if (!client.GetsStates() || client.connection.Busy()) continue;
      if (packet.empty()) packet = StatePacket(machine_.State(), machine_.geometry(), options_.model);
      client.connection.Send(packet);
    }
  }

  const ControllerOptions options_;
  SimClock* const clock_;
  Faults* const faults_;
  mutable std::recursive_mutex mutex_;  // a listener may ask for the pose while it is told of a motion
  Machine machine_;
  std::vector<std::string> commands_;
  std::mt19937_64 random_;
  RtdeSession::Taken taken_;
  std::list<Client> clients_;
  int listeners_[kPorts];
  int wake_ = -1;
  Ports ports_;
  bool frozen_ = false, dark_ = false, cut_off_ = false, input_came_ = false, readers_behind_ = false;
  double next_state_s_ = 0, last_turn_s_ = 0;
  std::atomic<bool> stop_{false};
  std::unique_ptr<SimClock::Part> part_;
  std::thread thread_;
};

}  // namespace

std::unique_ptr<Controller> Controller::Start(const ControllerOptions& options, SimClock* clock,
                                              Faults* faults, TipListener* tip) {
  return std::make_unique<EmulatedController>(options, clock, faults, tip);
}

}  // namespace touchstone::rig
