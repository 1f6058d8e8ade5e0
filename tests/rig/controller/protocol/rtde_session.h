// One RTDE client: its messages in, replies and data out. No sockets here.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "tests/rig/controller/protocol/rtde_fields.h"

namespace touchstone::rig {

class RtdeSession {
 public:
  // `taken`: input variables of all clients, with the session that holds each; outlives the session.
  using Taken = std::map<std::string, const RtdeSession*>;
  RtdeSession(Machine* machine, const std::string& model, Taken* taken);
  ~RtdeSession();
  RtdeSession(const RtdeSession&) = delete;
  RtdeSession& operator=(const RtdeSession&) = delete;

  // Takes the whole messages off the front of `bytes`; returns what is to be sent. Sets broken() where the
  // stream makes no sense any more.
  std::string Receive(std::string* bytes);
  bool broken() const { return broken_; }
  // Data wanted, how often (1 to the controller's rate), and one package of it.
  bool started() const { return started_; }
  double rate_hz() const { return rate_hz_; }
  std::string Data(const RobotState& state) const;

 private:
  std::string Reply(uint8_t type, std::string_view payload);
  std::string SetUpOutputs(std::string_view payload);
  std::string SetUpInputs(std::string_view payload);
  std::string TakeInputs(std::string_view payload);

  Machine* machine_;
  bool e_series_;
  Taken* taken_;
  bool broken_ = false, started_ = false;
  double rate_hz_;
  uint8_t recipe_ = 0;
  std::vector<const RtdeOutput*> outputs_;
  struct Input {
    std::string name;
    const RtdeInput* input;
  };
  std::map<int, std::vector<Input>> inputs_;
};

// One message of UR's Real-Time Data Exchange: u16 size (of all) | u8 type | payload, big-endian.
std::string RtdeMessage(uint8_t type, std::string_view payload);

}  // namespace touchstone::rig
