// The messages of RTDE (Real-Time Data Exchange), version 2. Every function takes bytes that came over the
// line as they are: what is malformed is an error (DATA_LOSS) that says what was wrong.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

namespace touchstone::gateway::arm {

enum class RtdeType : uint8_t {
  kVersion = 'V',
  kControllerVersion = 'v',
  kOutputs = 'O',
  kInputs = 'I',
  kStart = 'S',
  kPause = 'P',
  kData = 'U',
  kText = 'M'
};

struct RtdeMessage {
  uint8_t type = 0;
  std::string payload;
};

// Header and payload, as they go over the line.
std::string EncodeRtde(RtdeType type, absl::string_view payload);

// Cuts a stream of bytes into messages.
class RtdeFramer {
 public:
  void Append(absl::string_view bytes) { bytes_.append(bytes.data(), bytes.size()); }
  // The next whole message, or none yet. After an error the stream cannot be understood any more.
  absl::StatusOr<std::optional<RtdeMessage>> Next();
  void Clear() { bytes_.clear(), begin_ = 0; }

 private:
  std::string bytes_;
  size_t begin_ = 0;
};

// What this gateway asks of the controller, in the order in which it is packed.
struct RtdeSample {
  double timestamp_s = 0;  // the controller's clock
  std::array<double, 6> actual_q_rad{}, actual_qd_rad_s{};
  std::array<double, 6> actual_tcp_pose{};   // m, rotation vector
  std::array<double, 6> actual_tcp_speed{};  // m/s, rad/s
  std::array<double, 6> actual_tcp_force{};  // N, N m, base frame's axes, at the tool
  int32_t robot_mode = -1, safety_mode = 0;
  uint32_t runtime_state = 0, robot_status_bits = 0, safety_status_bits = 0;
  double speed_scaling = 0;          // of the trajectory limiter alone
  double target_speed_fraction = 0;  // the pendant's slider; the true speed is their product
  int32_t program_register = 0, phase_register = 0;
  std::array<double, 6> tcp_offset{};  // of the tool that actual_tcp_pose is of
  int32_t heartbeat_echo = 0;          // the newest heartbeat that the controller has got
  bool has_tcp_offset = false;         // and the heartbeat; old controllers do not tell them
};

// "timestamp,actual_q,...": the names of a sample's fields.
std::string RtdeOutputNames(bool with_tcp_offset);
std::string RtdeInputNames();  // the heartbeat and the command

// The reply to a recipe: its id, or an error that names the fields that are NOT_FOUND, IN_USE or
// of another type.
absl::StatusOr<uint8_t> ParseOutputRecipe(absl::string_view payload, bool with_tcp_offset);
absl::StatusOr<uint8_t> ParseInputRecipe(absl::string_view payload);

absl::StatusOr<RtdeSample> ParseSample(absl::string_view payload, uint8_t recipe, bool with_tcp_offset);
std::string EncodeInputs(uint8_t recipe, int32_t heartbeat, int32_t command);  // header included

absl::StatusOr<bool> ParseAccepted(absl::string_view payload);                  // of V, S, P
absl::StatusOr<std::string> ParseControllerVersion(absl::string_view payload);  // "5.12.4.1101661"
absl::StatusOr<std::string> ParseText(absl::string_view payload);               // "warning of RTDE: ..."

}  // namespace touchstone::gateway::arm
