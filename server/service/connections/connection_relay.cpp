#include "server/service/connections/connection_relay.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <signal.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstddef>
#include <cstring>
#include <map>
#include <optional>

#include "server/base/check.h"
#include "server/service/connections/frame_way.h"
#include "server/service/connections/relayed_peer.h"

namespace touchstone::service {
namespace {

constexpr size_t kReadBytes = 64 << 10;
// Of one connection before the next one's turn.
constexpr int kReadsOfATurn = 4;
// What a client has sent and has not been passed on, at the most, about.
constexpr size_t kMaxPendingBytes = 64 << 10;
constexpr int kTickMs = 5, kIdleTickMs = 200;
constexpr uint32_t kNoError = 0, kProtocolError = 1, kEnhanceYourCalm = 11;
// A connection that is for a stop lives no longer.
constexpr double kOnlyStopS = 10;

std::string GoAway(uint32_t last_stream, uint32_t error, absl::string_view words) {
  return FrameOf({0, FrameType::kGoAway, 0, 0},
                 absl::StrCat(BigEndianOf(last_stream, 4), BigEndianOf(error, 4), words));
}

}  // namespace

void RelayedConnection::AskToClose() {
  close_asked_ = true;
  const uint64_t one = 1;
  (void)!::write(wake_, &one, sizeof one);
}

// Serves its connections; all but Add happens on it.
class ConnectionRelay::Thread {
 public:
  Thread(const Limits& limits, SharedResets* resets, HandOver hand_over, SparseWarning* floods,
         std::atomic<size_t>* size)
      : limits_(limits), resets_(resets), hand_over_(std::move(hand_over)), floods_(*floods), size_(*size) {
    TOUCHSTONE_CHECK(poll_ >= 0 && wake_ >= 0);
    Watch(EPOLL_CTL_ADD, wake_, EPOLLIN, nullptr);
    thread_ = std::thread([this] { Run(); });
  }
  ~Thread() {
    ending_ = true;
    Wake();
    thread_.join();
    ::close(poll_);
    ::close(wake_);
  }

  std::shared_ptr<RelayedConnection> Add(NewConnection added);

 private:
  struct Connection;
  // An end of a connection; null: the eventfd.
  struct End {
    Connection* connection;
    bool inner;
  };
  struct Connection {
    Connection(NewConnection added, std::shared_ptr<RelayedConnection> shared, const Limits& limits,
               SharedResets* resets)
        : client(added.file),
          wire(std::move(added.wire)),
          shared(std::move(shared)),
          meter(limits, resets, std::move(added.address_calls), began, added.only_stop) {}

    const Clock::Time began = SteadyClock().Now();
    const int client;
    int inner = -1;  // the relay's end of the pair; -1: the client has not spoken yet
    std::unique_ptr<Wire> wire, inner_wire;
    std::shared_ptr<RelayedConnection> shared;
    FrameMeter meter;
    FrameWay from_client{kClientPreface.size()}, from_server{0};
    bool held = false;        // by the meter
    bool inner_gone = false;  // gRPC has closed it
    End client_end{this, false}, inner_end{this, true};
    uint32_t client_events = 0, inner_events = 0;  // that are watched
  };
  using Connections = std::map<Connection*, std::unique_ptr<Connection>>;

  void Wake() const {
    const uint64_t one = 1;
    (void)!::write(wake_, &one, sizeof one);
  }
  void Watch(int what, int file, uint32_t events, End* end) const {
    epoll_event event{};
    event.events = events;
    event.data.ptr = end;
    ::epoll_ctl(poll_, what, file, &event);
  }
  void Run();
  void TakeNew();
  void Tick(Clock::Time now);
  bool Serve(Connection* c, Clock::Time now);
  bool Greet(Connection* c);
  bool OpenInner(Connection* c);
  bool ReadClient(Connection* c, Clock::Time now);
  bool ReadServer(Connection* c);
  bool PassOn(Connection* c, absl::string_view read, Clock::Time now);
  void SetEvents(Connection* c) const;
  void SayGoodbye(Connection* c, uint32_t error, absl::string_view words) const;
  void Close(Connection* c);

  const Limits& limits_;
  SharedResets* const resets_;
  const HandOver hand_over_;
  SparseWarning& floods_;
  std::atomic<size_t>& size_;
  const int poll_ = ::epoll_create1(EPOLL_CLOEXEC), wake_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  std::atomic<bool> ending_{false};
  std::mutex mutex_;
  std::vector<std::unique_ptr<Connection>> new_;  // with mutex_
  Connections connections_;
  bool anyone_waits_ = false;
  Clock::Time ticked_{};
  std::vector<char> scratch_ = std::vector<char>(kReadBytes);
  std::thread thread_;
};

std::shared_ptr<RelayedConnection> ConnectionRelay::Thread::Add(NewConnection added) {
  const auto shared = std::make_shared<RelayedConnection>(std::move(added.peer), added.only_stop, wake_);
  shared->idle_since_s_ = SteadyClock().NowS();
  ++size_;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    new_.push_back(std::make_unique<Connection>(std::move(added), shared, limits_, resets_));
  }
  Wake();
  return shared;
}

void ConnectionRelay::Thread::TakeNew() {
  uint64_t count = 0;
  (void)!::read(wake_, &count, sizeof count);
  std::vector<std::unique_ptr<Connection>> added;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    added.swap(new_);
  }
  for (std::unique_ptr<Connection>& c : added) {
    Connection* const raw = c.get();
    connections_.emplace(raw, std::move(c));
    raw->client_events = EPOLLIN;
    Watch(EPOLL_CTL_ADD, raw->client, EPOLLIN, &raw->client_end);
  }
}

void ConnectionRelay::Thread::Run() {
  // OpenSSL writes to sockets without MSG_NOSIGNAL.
  sigset_t broken_pipe;
  sigemptyset(&broken_pipe);
  sigaddset(&broken_pipe, SIGPIPE);
  ::pthread_sigmask(SIG_BLOCK, &broken_pipe, nullptr);
  std::vector<epoll_event> events(64);
  while (!ending_) {
    const int count = ::epoll_wait(poll_, events.data(), static_cast<int>(events.size()),
                                   anyone_waits_ ? kTickMs : kIdleTickMs);
    const Clock::Time now = SteadyClock().Now();
    std::map<Connection*, bool> ready;  // once each, though both its ends may be; whether the client is gone
    bool woken = false;
    for (int k = 0; k < count; ++k) {
      const End* const end = static_cast<const End*>(events[k].data.ptr);
      const bool gone = (events[k].events & (EPOLLERR | EPOLLHUP)) != 0;
      if (end == nullptr) {
        woken = true;
        continue;
      }
      bool& client_gone = ready[end->connection];
      client_gone = client_gone || (gone && !end->inner);
      // What gRPC said last may still have to wait for the client: until then it is not looked at for ever.
      if (gone && end->inner) {
        end->connection->inner_gone = true;
        Watch(EPOLL_CTL_DEL, end->connection->inner, 0, nullptr);
      }
    }
    for (const auto& [c, client_gone] : ready)
      if (client_gone || !Serve(c, now)) Close(c);
    if (woken) TakeNew();
    // Also while others keep it busy.
    if (woken || now - ticked_ >= std::chrono::milliseconds(anyone_waits_ ? kTickMs : kIdleTickMs)) Tick(now);
  }
  while (!connections_.empty()) Close(connections_.begin()->first);
}

// Those that wait for the time, not for bytes.
void ConnectionRelay::Thread::Tick(Clock::Time now) {
  ticked_ = now;
  anyone_waits_ = false;
  for (auto each = connections_.begin(); each != connections_.end();) {
    Connection* const c = (each++)->first;
    const double age_s = std::chrono::duration<double>(now - c->began).count();
    const bool too_old =
        (c->inner < 0 && age_s > limits_.handshake_s) || (c->shared->only_stop() && age_s > kOnlyStopS);
    const bool to_close = c->shared->close_asked_ && c->meter.open_calls() == 0;
    if (to_close) SayGoodbye(c, kNoError, "touchstone: a newer connection takes the place of an idle one");
    if (too_old || to_close || (c->held && !Serve(c, now))) {
      Close(c);
      continue;
    }
    anyone_waits_ = anyone_waits_ || c->held;
  }
}

// False: it is to be closed.
bool ConnectionRelay::Thread::Serve(Connection* c, Clock::Time now) {
  if (c->inner < 0 && !Greet(c)) return false;
  const uint64_t answered = c->from_server.passed();
  if (c->inner >= 0 && !ReadServer(c)) return false;
  if (!c->from_server.stuck() || c->from_server.passed() > answered) c->meter.AnswersMove();
  if (c->inner >= 0 && !ReadClient(c, now)) return false;
  anyone_waits_ = anyone_waits_ || c->held;
  const size_t open = c->meter.open_calls();
  if (open == 0 && c->shared->open_calls_ != 0) c->shared->idle_since_s_ = SteadyClock().NowS();
  c->shared->open_calls_ = open;
  SetEvents(c);
  return true;
}

// gRPC does not see those who say nothing, or something else.
bool ConnectionRelay::Thread::Greet(Connection* c) {
  std::string& said = c->from_client.pending();
  while (said.size() < kClientPreface.size()) {
    const Wire::Moved read = c->wire->Read(scratch_.data(), kClientPreface.size() - said.size());
    if (read.state == Wire::State::kEnded) return false;
    if (read.state == Wire::State::kBlocked) return true;
    said.append(scratch_.data(), read.bytes);
    if (!absl::StartsWith(kClientPreface, said)) {
      // What gRPC would say at once: a client that speaks TLS here, or HTTP/1, finds that this is something else, and not
      // a server that is still starting. What it has sent is read first, or closing would take the answer back.
      while (c->wire->Read(scratch_.data(), scratch_.size()).state == Wire::State::kMoved) {
      }
      c->wire->Write(FrameOf({0, FrameType::kSettings, 0, 0}, "") +
                     GoAway(0, kProtocolError, "touchstone: HTTP/2 was expected here"));
      return false;
    }
  }
  c->shared->spoke_ = true;
  return OpenInner(c);
}

bool ConnectionRelay::Thread::OpenInner(Connection* c) {
  int pair[2];
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, pair) != 0) return false;
  static std::atomic<uint64_t> number{0};
  const std::string name = RelayedPeerName(++number, c->shared->peer());
  sockaddr_un address{};
  address.sun_family = AF_UNIX;  // a name that begins with a zero is no file
  std::memcpy(address.sun_path + 1, name.data(), std::min(name.size(), sizeof address.sun_path - 1));
  ::bind(pair[0], reinterpret_cast<const sockaddr*>(&address),
         static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size()));
  c->inner = pair[0];
  c->inner_wire = PlainWire(c->inner);
  c->inner_events = EPOLLIN;
  Watch(EPOLL_CTL_ADD, c->inner, EPOLLIN, &c->inner_end);
  hand_over_(pair[1]);
  return true;
}

bool ConnectionRelay::Thread::PassOn(Connection* c, absl::string_view read, Clock::Time now) {
  FrameMeter::Verdict verdict = FrameMeter::Verdict::kPass;
  const auto admit = [&](const FrameHead& head, absl::string_view payload) {
    verdict = c->meter.FromClient(head, payload, now);
    return verdict == FrameMeter::Verdict::kPass;
  };
  const bool open = c->from_client.Pass(read, admit, c->inner_wire.get());
  c->held = verdict == FrameMeter::Verdict::kLater;
  if (verdict == FrameMeter::Verdict::kShut) {
    floods_.Say(absl::StrCat(c->shared->peer(), ": the connection is closed: ", c->meter.reason()));
    SayGoodbye(c, kEnhanceYourCalm, "touchstone: " + c->meter.reason());
    return false;
  }
  return open;
}

bool ConnectionRelay::Thread::ReadClient(Connection* c, Clock::Time now) {
  if (!PassOn(c, "", now)) return false;
  for (int k = 0; k < kReadsOfATurn || c->wire->buffered(); ++k) {
    if (c->from_client.stuck()) return true;
    if (c->held && c->from_client.pending().size() >= kMaxPendingBytes) return true;
    const Wire::Moved read = c->wire->Read(scratch_.data(), scratch_.size());
    if (read.state == Wire::State::kEnded) return false;
    if (read.state == Wire::State::kBlocked) {
      if (!c->held) c->meter.NothingWaits();
      return true;
    }
    if (!PassOn(c, absl::string_view(scratch_.data(), read.bytes), now)) return false;
  }
  return true;
}

bool ConnectionRelay::Thread::ReadServer(Connection* c) {
  const auto watch = [c](const FrameHead& head, absl::string_view) {
    c->meter.FromServer(head);
    return true;
  };
  if (!c->from_server.Pass("", watch, c->wire.get())) return false;
  for (int k = 0; (k < kReadsOfATurn || c->inner_gone) && !c->from_server.stuck(); ++k) {
    const Wire::Moved read = c->inner_wire->Read(scratch_.data(), scratch_.size());
    if (read.state == Wire::State::kEnded) return false;
    if (read.state == Wire::State::kBlocked) return true;
    if (!c->from_server.Pass(absl::string_view(scratch_.data(), read.bytes), watch, c->wire.get()))
      return false;
  }
  return true;
}

void ConnectionRelay::Thread::SetEvents(Connection* c) const {
  const bool reads_client =
      !(c->held && c->from_client.pending().size() >= kMaxPendingBytes) && !c->from_client.stuck();
  const uint32_t client = (reads_client ? EPOLLIN : 0u) |
                          (c->from_server.stuck() || c->wire->reads_when_writable() ? EPOLLOUT : 0u);
  const uint32_t inner = (c->from_server.stuck() ? 0u : EPOLLIN) | (c->from_client.stuck() ? EPOLLOUT : 0u);
  if (client != c->client_events) Watch(EPOLL_CTL_MOD, c->client, client, &c->client_end);
  if (c->inner >= 0 && inner != c->inner_events) Watch(EPOLL_CTL_MOD, c->inner, inner, &c->inner_end);
  c->client_events = client;
  c->inner_events = inner;
}

void ConnectionRelay::Thread::SayGoodbye(Connection* c, uint32_t error, absl::string_view words) const {
  if (c->inner < 0 || !c->from_server.between_frames()) return;
  c->wire->Write(GoAway(error == kNoError ? c->meter.last_stream() : 0x7fffffff, error, words));
}

void ConnectionRelay::Thread::Close(Connection* c) {
  ::close(c->client);
  if (c->inner >= 0) ::close(c->inner);
  c->shared->closed_ = true;
  --size_;
  connections_.erase(c);
}

ConnectionRelay::ConnectionRelay(const Limits& limits, int threads, HandOver hand_over)
    : resets_(std::make_unique<SharedResets>(limits, SteadyClock().Now())) {
  for (int k = 0; k < threads; ++k)
    threads_.push_back(std::make_unique<Thread>(limits, resets_.get(), hand_over, &floods_, &size_));
}

ConnectionRelay::~ConnectionRelay() = default;

std::shared_ptr<RelayedConnection> ConnectionRelay::Add(NewConnection connection) {
  return threads_[next_++ % threads_.size()]->Add(std::move(connection));
}

}  // namespace touchstone::service
