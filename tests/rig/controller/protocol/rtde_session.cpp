#include "tests/rig/controller/protocol/rtde_session.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace touchstone::rig {
namespace {

constexpr size_t kHeaderBytes = 3;

// Names between commas; a comma at the end adds none.
std::vector<std::string> Names(std::string_view list) {
  std::vector<std::string> names;
  std::string name;
  for (const char c : list) {
    if (c == ',') {
      names.push_back(name);
      name.clear();
    } else if (c != ' ' && c != '\0') {
      name.push_back(c);
    }
  }
  if (!name.empty()) names.push_back(name);
  return names;
}

std::string Text(const std::string& message, uint8_t level) {
  const std::string source = "RTDE";
  const std::string cut = message.substr(0, 255);
  WireWriter to;
  to.Put(static_cast<uint8_t>(cut.size()))
      .Text(cut)
      .Put(static_cast<uint8_t>(source.size()))
      .Text(source)
      .Put(level);
  return RtdeMessage('M', to.bytes);
}

// Registers that came with 3.9 (CB3) and 5.3 (e-Series).
bool IsUpperRegister(const std::string& name) {
  const size_t number = name.find("register_");
  if (number == std::string::npos) return false;
  const int index = std::atoi(name.c_str() + number + 9);
  return name.find("_bit_") == std::string::npos && index >= 24 && index < 48;
}

}  // namespace

std::string RtdeMessage(uint8_t type, std::string_view payload) {
  WireWriter to;
  to.Put(static_cast<uint16_t>(kHeaderBytes + payload.size())).Put(type).Text(payload);
  return to.bytes;
}

RtdeSession::RtdeSession(Machine* machine, const std::string& model, Taken* taken)
    : machine_(machine), e_series_(model == "ur3e"), taken_(taken), rate_hz_(1 / machine->cycle_s()) {}

RtdeSession::~RtdeSession() {
  for (auto it = taken_->begin(); it != taken_->end();)
    it = it->second == this ? taken_->erase(it) : std::next(it);
}

std::string RtdeSession::Receive(std::string* bytes) {
  std::string replies;
  while (bytes->size() >= kHeaderBytes) {
    WireReader header(*bytes);
    const size_t size = header.Get<uint16_t>();
    const uint8_t type = header.Get<uint8_t>();
    if (size < kHeaderBytes) {
      broken_ = true;
      return replies;
    }
    if (bytes->size() < size) break;
    replies += Reply(type, std::string_view(*bytes).substr(kHeaderBytes, size - kHeaderBytes));
    bytes->erase(0, size);
  }
  return replies;
}

std::string RtdeSession::Reply(uint8_t type, std::string_view payload) {
  const std::string yes(1, '\1'), no(1, '\0');
  switch (type) {
    case 'V': {
      WireReader from(payload);
      return RtdeMessage('V', from.Get<uint16_t>() == 2 && from.ok ? yes : no);
    }
    case 'v': {
      WireWriter to;
      if (machine_->OldSoftware())
        to.Put(uint32_t{e_series_ ? 5u : 3u})
            .Put(uint32_t{e_series_ ? 2u : 8u})
            .Put(uint32_t{0})
            .Put(uint32_t{61336});
      else if (e_series_)
        to.Put(uint32_t{5}).Put(uint32_t{11}).Put(uint32_t{0}).Put(uint32_t{108249});
      else
        to.Put(uint32_t{3}).Put(uint32_t{15}).Put(uint32_t{8}).Put(uint32_t{106339});
      return RtdeMessage('v', to.bytes);
    }
    case 'O':
      return SetUpOutputs(payload);
    case 'I':
      return SetUpInputs(payload);
    case 'S':
      started_ = !outputs_.empty();
      return RtdeMessage('S', started_ ? yes : no);
    case 'P':
      started_ = false;
      return RtdeMessage('P', yes);
    case 'U':
      return TakeInputs(payload);
    case 'M':
      return "";
    default:
      return Text("unknown package type " + std::to_string(type), 1);
  }
}

std::string RtdeSession::SetUpOutputs(std::string_view payload) {
  started_ = false;
  outputs_.clear();
  WireReader from(payload);
  const double most = 1 / machine_->cycle_s();
  const double hz = from.Get<double>();
  if (!from.ok) return Text("an output recipe begins with its frequency", 1);
  rate_hz_ = std::isfinite(hz) && hz > 0 ? std::clamp(hz, 1.0, most) : most;
  std::string types;
  bool all = true;
  for (const std::string& name : Names(from.left)) {
    const auto row = RtdeOutputs().find(name);
    const bool found = row != RtdeOutputs().end() && (e_series_ || !row->second.e_series_only) &&
                       !(machine_->OldSoftware() && IsUpperRegister(name));
    if (found) outputs_.push_back(&row->second);
    all &= found;
    types += (types.empty() ? "" : ",") + (found ? row->second.type : "NOT_FOUND");
  }
  if (!all) outputs_.clear();
  recipe_ = outputs_.empty() ? 0 : 1;
  return RtdeMessage('O', std::string(1, static_cast<char>(recipe_)) + types);
}

std::string RtdeSession::SetUpInputs(std::string_view payload) {
  std::vector<Input> recipe;
  std::string types;
  bool all = true;
  for (const std::string& name : Names(payload)) {
    const auto found = RtdeInputs().find(name);
    const bool known = found != RtdeInputs().end() && !(machine_->OldSoftware() && IsUpperRegister(name));
    std::string type = known ? found->second.type : "NOT_FOUND";
    const auto holder = taken_->find(name);
    if (holder != taken_->end() && holder->second != this) type = "IN_USE";
    if (type == "NOT_FOUND" || type == "IN_USE")
      all = false;
    else
      recipe.push_back({name, &found->second});
    types += (types.empty() ? "" : ",") + type;
  }
  uint8_t id = 0;
  if (all && !recipe.empty() && inputs_.size() < 255) {
    for (const Input& input : recipe) (*taken_)[input.name] = this;
    id = static_cast<uint8_t>(inputs_.size() + 1);
    inputs_[id] = std::move(recipe);
  }
  return RtdeMessage('I', std::string(1, static_cast<char>(id)) + types);
}

std::string RtdeSession::TakeInputs(std::string_view payload) {
  WireReader from(payload);
  const int id = from.Get<uint8_t>();
  const auto recipe = inputs_.find(id);
  if (!from.ok || recipe == inputs_.end()) return Text("no input recipe has the id " + std::to_string(id), 1);
  size_t bytes = 0;
  for (const Input& input : recipe->second) bytes += input.input->bytes;
  // What is longer is read as far as the recipe goes, an assumption: ur_rtde 1.6.5 sends getForwardKinematics(q, tcp) with a
  // tool of zeros as 12 numbers of a recipe of 6, and waited for ever for the answer to what was refused.
  if (from.left.size() < bytes)
    return Text("input recipe " + std::to_string(id) + " takes " + std::to_string(bytes) + " bytes, not " +
                    std::to_string(from.left.size()),
                1);
  for (const Input& input : recipe->second) {
    input.input->read(machine_, &from);
    machine_->InputWritten(input.name);
  }
  return "";
}

std::string RtdeSession::Data(const RobotState& state) const {
  WireWriter to;
  to.Put(recipe_);
  for (const RtdeOutput* output : outputs_) output->write(state, &to);
  return RtdeMessage('U', to.bytes);
}

}  // namespace touchstone::rig
