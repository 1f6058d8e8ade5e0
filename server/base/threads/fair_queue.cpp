#include "server/base/threads/fair_queue.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace touchstone {
namespace {

void Take(FairQueue::Turns* turns) {
  turns->used_s += FairQueue::kExpectedS;
  ++turns->running;
}

void PutBack(FairQueue::Turns* turns) {
  turns->used_s -= FairQueue::kExpectedS;
  --turns->running;
}

}  // namespace

// Who comes anew begins where the others are, so that nobody saves up time by idling.
void FairQueue::Add(const std::string& client, uint64_t stream, Task task) {
  Client& owner = clients_[client];
  if (owner.waiting == 0 && owner.running == 0) owner.used_s = std::max(owner.used_s, turn_s_);
  Stream& queue = owner.streams[stream];
  if (queue.tasks.empty() && queue.running == 0) queue.used_s = std::max(queue.used_s, owner.turn_s);
  queue.client = &owner;
  queue.tasks.push_back(std::move(task));
  ++owner.waiting;
  ++waiting_;
}

FairQueue::Stream* FairQueue::NextStream() const {
  const Client* client = nullptr;
  for (const auto& [name, each] : clients_)
    if (each.waiting > 0 && (client == nullptr || each.used_s < client->used_s)) client = &each;
  if (client == nullptr) return nullptr;
  const Stream* stream = nullptr;
  for (const auto& [number, each] : client->streams)
    if (!each.tasks.empty() && (stream == nullptr || each.used_s < stream->used_s)) stream = &each;
  return const_cast<Stream*>(stream);
}

std::optional<FairQueue::Begun> FairQueue::Begin() {
  Stream* const stream = NextStream();
  if (stream == nullptr) return std::nullopt;
  Client* const client = stream->client;
  Begun begun{stream, std::move(stream->tasks.front())};
  stream->tasks.pop_front();
  --client->waiting;
  --waiting_;
  turn_s_ = std::max(turn_s_, client->used_s);
  client->turn_s = std::max(client->turn_s, stream->used_s);
  Take(stream);
  Take(client);
  return begun;
}

void FairQueue::Charge(Stream* stream, double took_s) {
  stream->used_s += took_s;
  stream->client->used_s += took_s;
}

// As Begin would choose if the task went back among the waiting.
bool FairQueue::OthersAreNext(const Stream& stream) const {
  const Client& client = *stream.client;
  for (const auto& [name, each] : clients_)
    if (&each != &client && each.waiting > 0 && each.used_s < client.used_s - kExpectedS) return true;
  // It is this client's turn.
  for (const auto& [number, each] : client.streams)
    if (&each != &stream && !each.tasks.empty() && each.used_s < stream.used_s - kExpectedS) return true;
  return false;
}

void FairQueue::GoOnLater(Stream* stream, Task rest) {
  stream->tasks.push_front(std::move(rest));  // first: where there is no memory nothing has changed
  PutBack(stream);
  PutBack(stream->client);
  ++stream->client->waiting;
  ++waiting_;
}

void FairQueue::End(Stream* stream) {
  PutBack(stream);
  PutBack(stream->client);
  ForgetIdle();
}

// A client that used more than its share is remembered until the others have had theirs. A stream is not: few come back,
// and a long task of one gives way to the others while it runs.
void FairQueue::ForgetIdle() {
  for (auto client = clients_.begin(); client != clients_.end();) {
    Client& each = client->second;
    for (auto stream = each.streams.begin(); stream != each.streams.end();)
      stream = stream->second.tasks.empty() && stream->second.running == 0 ? each.streams.erase(stream)
                                                                           : std::next(stream);
    client = each.streams.empty() && each.used_s <= turn_s_ ? clients_.erase(client) : std::next(client);
  }
}

}  // namespace touchstone
