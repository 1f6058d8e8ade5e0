// Tasks of several clients, each of whom may have several streams, in turn. Next is a task of the client whose tasks have
// taken the least processor time, and of that client's streams the one of which the same is true: whoever asks for
// little does not wait for all that others have asked for, not even where they look like one client, as behind one
// address. (Fair queueing in two levels, by time and not by tasks, since what a task costs is not known before.)
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>

namespace touchstone {

class FairQueue {
 public:
  // What counts as taken while a task runs and nothing is known of it, so that several threads that look for a task do
  // not all find the same client.
  static constexpr double kExpectedS = 0.02;

  struct Task {
    std::function<void()> run;
    bool resumes = false;  // not a beginning: lets a thread go on that stopped in the middle of a task
  };
  // What one had of its turns, among others of its kind.
  struct Turns {
    int running = 0;    // tasks
    double used_s = 0;  // processor time, with what is expected of those
  };
  struct Client;
  struct Stream : Turns {
    Client* client = nullptr;
    std::deque<Task> tasks;  // in the order given
  };
  struct Client : Turns {
    std::map<uint64_t, Stream> streams;
    double turn_s = 0;   // used_s of the stream whose turn it was last
    size_t waiting = 0;  // tasks
  };
  struct Begun {
    Stream* stream;  // lives until End
    Task task;
  };

  size_t waiting() const { return waiting_; }

  void Add(const std::string& client, uint64_t stream, Task task);
  // A task of those whose turn it is; nothing where none waits.
  std::optional<Begun> Begin();
  // A task of this stream, which runs, has taken so much processor time since its begin or since this was said last.
  void Charge(Stream* stream, double took_s);
  // Whether others have waited for their turn while a task of this stream, all of it charged, was running.
  bool OthersAreNext(const Stream& stream) const;
  // It stops in the middle; `rest` goes on with it, before the stream's other tasks.
  void GoOnLater(Stream* stream, Task rest);
  // It has ended, all of it charged.
  void End(Stream* stream);

 private:
  Stream* NextStream() const;
  void ForgetIdle();

  std::map<std::string, Client> clients_;
  double turn_s_ = 0;  // as Client::turn_s, of clients
  size_t waiting_ = 0;
};

}  // namespace touchstone
