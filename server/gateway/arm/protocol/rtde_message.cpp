#include "server/gateway/arm/protocol/rtde_message.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>

#include <cmath>

#include "server/gateway/arm/protocol/big_endian.h"
#include "server/gateway/arm/protocol/registers.h"

namespace touchstone::gateway::arm {
namespace {

constexpr size_t kPackageHeaderBytes = 3;

struct Field {
  std::string name, type;
};

std::vector<Field> OutputFields(bool with_tcp_offset) {
  std::vector<Field> fields = {{"timestamp", "DOUBLE"},
                               {"actual_q", "VECTOR6D"},
                               {"actual_qd", "VECTOR6D"},
                               {"actual_TCP_pose", "VECTOR6D"},
                               {"actual_TCP_speed", "VECTOR6D"},
                               {"actual_TCP_force", "VECTOR6D"},
                               {"robot_mode", "INT32"},
                               {"safety_mode", "INT32"},
                               {"runtime_state", "UINT32"},
                               {"robot_status_bits", "UINT32"},
                               {"safety_status_bits", "UINT32"},
                               {"speed_scaling", "DOUBLE"},
                               {"target_speed_fraction", "DOUBLE"},
                               {absl::StrCat("output_int_register_", kProgramRegister), "INT32"},
                               {absl::StrCat("output_int_register_", kPhaseRegister), "INT32"}};
  // Newer controllers tell these too: the tool, and our own heartbeat as it has arrived.
  if (with_tcp_offset) {
    fields.push_back({"tcp_offset", "VECTOR6D"});
    fields.push_back({absl::StrCat("input_int_register_", kHeartbeatRegister), "INT32"});
  }
  return fields;
}

std::vector<Field> InputFields() {
  return {{absl::StrCat("input_int_register_", kHeartbeatRegister), "INT32"},
          {absl::StrCat("input_int_register_", kCommandRegister), "INT32"}};
}

std::string Names(const std::vector<Field>& fields) {
  return absl::StrJoin(fields, ",", [](std::string* out, const Field& field) { out->append(field.name); });
}

absl::StatusOr<uint8_t> ParseRecipe(absl::string_view payload, const std::vector<Field>& fields) {
  BigEndianReader reader(payload);
  const uint8_t recipe = reader.U8();
  absl::string_view text = reader.Rest();
  while (!text.empty() && (text.back() == ',' || text.back() == '\0')) text.remove_suffix(1);
  const std::vector<std::string> types = absl::StrSplit(text, ',');
  if (!reader.ok() || types.size() != fields.size())
    return absl::DataLossError(absl::StrCat("RTDE: the reply to a recipe of ", fields.size(), " fields has ",
                                            payload.empty() ? 0 : types.size()));
  std::vector<std::string> wrong;
  for (size_t i = 0; i < fields.size(); ++i) {
    if (types[i] != fields[i].type)
      wrong.push_back(
          absl::StrCat(fields[i].name, ": ", types[i].substr(0, 32), " instead of ", fields[i].type));
  }
  if (wrong.empty() && recipe != 0) return recipe;
  std::string hint =
      absl::StrContains(text, "IN_USE") ? "; another RTDE client writes these registers: end it" : "";
  // UR, RTDE guide (article 22229): integer registers 24 to 47 from 3.9.0 and 5.3.0.
  for (const std::string& each : wrong)
    if (absl::StrContains(each, "_int_register_") && absl::StrContains(each, "NOT_FOUND"))
      hint =
          "; registers 24 to 47 came with PolyScope 3.9.0 (CB3) and 5.3.0 (e-Series): update the controller";
  return absl::FailedPreconditionError(
      absl::StrCat("RTDE: the controller refuses the recipe (", absl::StrJoin(wrong, ", "), ")", hint));
}

std::array<double, 6> Vector6(BigEndianReader* reader) {
  std::array<double, 6> values;
  for (double& value : values) value = reader->F64();
  return values;
}

bool Finite(const std::array<double, 6>& values) {
  for (const double value : values)
    if (!std::isfinite(value)) return false;
  return true;
}

}  // namespace

std::string EncodeRtde(RtdeType type, absl::string_view payload) {
  return BigEndianWriter()
      .U16(static_cast<uint16_t>(payload.size() + kPackageHeaderBytes))
      .U8(static_cast<uint8_t>(type))
      .Bytes(payload)
      .bytes();
}

absl::StatusOr<std::optional<RtdeMessage>> RtdeFramer::Next() {
  BigEndianReader reader(absl::string_view(bytes_).substr(begin_));
  const size_t there = bytes_.size() - begin_;
  if (there >= 2) {
    const size_t size = reader.U16();
    if (size < kPackageHeaderBytes)
      return absl::DataLossError(absl::StrCat("RTDE: a message of ", size, " bytes; the header alone has 3"));
    if (there >= size) {
      RtdeMessage message;
      message.type = reader.U8();
      message.payload = std::string(reader.Bytes(size - kPackageHeaderBytes));
      begin_ += size;
      return std::optional<RtdeMessage>(std::move(message));
    }
  }
  bytes_.erase(0, begin_);
  begin_ = 0;
  return std::optional<RtdeMessage>();
}

std::string RtdeOutputNames(bool with_tcp_offset) {
  return Names(OutputFields(with_tcp_offset));
}

std::string RtdeInputNames() {
  return Names(InputFields());
}

absl::StatusOr<uint8_t> ParseOutputRecipe(absl::string_view payload, bool with_tcp_offset) {
  return ParseRecipe(payload, OutputFields(with_tcp_offset));
}

absl::StatusOr<uint8_t> ParseInputRecipe(absl::string_view payload) {
  return ParseRecipe(payload, InputFields());
}

absl::StatusOr<RtdeSample> ParseSample(absl::string_view payload, uint8_t recipe, bool with_tcp_offset) {
  BigEndianReader reader(payload);
  const uint8_t its_recipe = reader.U8();
  RtdeSample sample;
  sample.timestamp_s = reader.F64();
  sample.actual_q_rad = Vector6(&reader);
  sample.actual_qd_rad_s = Vector6(&reader);
  sample.actual_tcp_pose = Vector6(&reader);
  sample.actual_tcp_speed = Vector6(&reader);
  sample.actual_tcp_force = Vector6(&reader);
  sample.robot_mode = reader.I32();
  sample.safety_mode = reader.I32();
  sample.runtime_state = reader.U32();
  sample.robot_status_bits = reader.U32();
  sample.safety_status_bits = reader.U32();
  sample.speed_scaling = reader.F64();
  sample.target_speed_fraction = reader.F64();
  sample.program_register = reader.I32();
  sample.phase_register = reader.I32();
  sample.has_tcp_offset = with_tcp_offset;
  if (with_tcp_offset) {
    sample.tcp_offset = Vector6(&reader);
    sample.heartbeat_echo = reader.I32();
  }
  if (!reader.ok() || !reader.AtEnd())
    return absl::DataLossError(
        absl::StrCat("RTDE: a data package of ", payload.size(), " bytes does not fit its recipe"));
  if (its_recipe != recipe)
    return absl::DataLossError(absl::StrCat("RTDE: a data package of recipe ", int{its_recipe}, "; ",
                                            int{recipe}, " was agreed on"));
  if (!std::isfinite(sample.timestamp_s) || !Finite(sample.actual_q_rad) || !Finite(sample.actual_qd_rad_s) ||
      !Finite(sample.actual_tcp_pose) || !Finite(sample.actual_tcp_speed) ||
      !Finite(sample.actual_tcp_force) || !Finite(sample.tcp_offset))
    return absl::DataLossError("RTDE: a data package has numbers that are not finite");
  return sample;
}

std::string EncodeInputs(uint8_t recipe, int32_t heartbeat, int32_t command) {
  return EncodeRtde(RtdeType::kData, BigEndianWriter().U8(recipe).I32(heartbeat).I32(command).bytes());
}

absl::StatusOr<bool> ParseAccepted(absl::string_view payload) {
  if (payload.size() != 1)
    return absl::DataLossError(
        absl::StrCat("RTDE: a yes or no of ", payload.size(), " bytes; 1 was expected"));
  return payload[0] != 0;
}

absl::StatusOr<std::string> ParseControllerVersion(absl::string_view payload) {
  BigEndianReader reader(payload);
  const uint32_t major = reader.U32(), minor = reader.U32(), bugfix = reader.U32(), build = reader.U32();
  if (!reader.ok())
    return absl::DataLossError(
        absl::StrCat("RTDE: a version of ", payload.size(), " bytes; 16 were expected"));
  return absl::StrCat(major, ".", minor, ".", bugfix, ".", build);
}

absl::StatusOr<std::string> ParseText(absl::string_view payload) {
  BigEndianReader reader(payload);
  const absl::string_view message = reader.Bytes(reader.U8());
  const absl::string_view source = reader.Bytes(reader.U8());
  const uint8_t level = reader.U8();
  if (!reader.ok()) return absl::DataLossError("RTDE: a text message that ends too early");
  static constexpr const char* kLevels[] = {"exception", "error", "warning", "info"};
  return absl::StrCat(level < 4 ? kLevels[level] : "message", " of ", source, ": ", message);
}

}  // namespace touchstone::gateway::arm
