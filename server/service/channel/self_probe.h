// Ends a process that nobody can reach any more, so that systemd or Kubernetes starts it anew.
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include <grpcpp/client_context.h>

#include "server/base/threads/clock.h"

namespace touchstone::service {

// Where others connect to the server of this machine: "0.0.0.0:50051" is "127.0.0.1:50051" from here.
std::string OwnAddress(const std::string& listen, int port);

// Asks the server's health check through its own port, over a new connection each time as a stranger's would be; with
// TLS, whatever its certificate. Unreachable is who does not answer at all, several times in a row, within a time that is long for
// a busy machine; a refusal is an answer. It counts questions and not hours, so a clock that jumps or a machine that slept
// changes nothing.
class SelfProbe {
 public:
  static constexpr int kUnanswered = 3;
  // Asks every `every_s` seconds of `clock`; an answer has `answer_s`. `on_deaf` is called once, from a thread of its own, after
  // `unanswered` questions in a row, at least one.
  SelfProbe(const std::string& address, bool tls, double every_s, double answer_s,
            std::function<void()> on_deaf, int unanswered = kUnanswered, const Clock& clock = SteadyClock());
  ~SelfProbe();
  SelfProbe(const SelfProbe&) = delete;
  SelfProbe& operator=(const SelfProbe&) = delete;

 private:
  void Run();
  bool Answers();

  const std::string address_;
  const bool tls_;
  const double every_s_, answer_s_;
  const std::function<void()> on_deaf_;
  const int unanswered_;
  const Clock& clock_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;
  grpc::ClientContext* asking_ = nullptr;  // the question under way
  std::thread thread_;
};

}  // namespace touchstone::service
