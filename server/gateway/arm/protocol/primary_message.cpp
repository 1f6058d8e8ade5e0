#include "server/gateway/arm/protocol/primary_message.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/gateway/arm/protocol/big_endian.h"

namespace touchstone::gateway::arm {
namespace {

constexpr size_t kHeaderBytes = 5, kLargestBytes = 1 << 20;
constexpr uint8_t kState = 16, kMessage = 20;
constexpr uint8_t kKinematics = 5;                               // part of a state
constexpr uint8_t kError = 6, kKeyMessage = 7, kException = 10;  // kinds of messages

// Text of the controller as it may stand in a message of ours.
std::string Printable(absl::string_view text) {
  std::string kept;
  for (const char c : text.substr(0, 300)) kept.push_back(c >= ' ' && c <= '~' ? c : ' ');
  return kept;
}

absl::StatusOr<DhTable> ParseKinematics(BigEndianReader reader) {
  reader.Bytes(6 * 4);  // checksums
  DhTable table;
  for (DhRow& row : table) row.theta_rad = reader.F64();
  for (DhRow& row : table) row.a_m = reader.F64();
  for (DhRow& row : table) row.d_m = reader.F64();
  for (DhRow& row : table) row.alpha_rad = reader.F64();
  if (!reader.ok()) return absl::DataLossError("the primary interface sends kinematics that end too early");
  return table;
}

absl::Status ParseState(BigEndianReader reader, PrimaryUpdate* update) {
  while (!reader.AtEnd()) {
    const uint32_t size = reader.U32();
    const uint8_t type = reader.U8();
    if (!reader.ok() || size < kHeaderBytes)
      return absl::DataLossError("the primary interface sends a state with a part that has no size");
    const absl::string_view body = reader.Bytes(size - kHeaderBytes);
    if (!reader.ok()) return absl::DataLossError("the primary interface sends a state that ends too early");
    if (type == kKinematics) {
      TOUCHSTONE_ASSIGN_OR_RETURN(update->kinematics, ParseKinematics(BigEndianReader(body)));
    }
  }
  return absl::OkStatus();
}

void ParseMessage(BigEndianReader reader, PrimaryUpdate* update) {
  reader.U64();  // its time
  reader.U8();   // and where it comes from
  const uint8_t kind = reader.U8();
  if (kind == kKeyMessage) {
    reader.I32(), reader.I32();
    const std::string title = Printable(reader.Bytes(reader.U8()));
    const std::string text = Printable(reader.Rest());
    if (!reader.ok()) return;
    update->message = absl::StrCat(title, " ", text);
    if (title == "PROGRAM_XXX_STARTED") update->started = text;
    if (title == "PROGRAM_XXX_STOPPED") update->stopped = text;
  } else if (kind == kError) {
    const int32_t code = reader.I32(), argument = reader.I32(), level = reader.I32();
    reader.U32(), reader.U32();
    const std::string text = Printable(reader.Rest());
    if (!reader.ok() || level < 2) return;  // below a warning
    update->is_error = true;
    update->message = absl::StrCat("C", code, "A", argument, " ", text);
  } else if (kind == kException) {
    const int32_t line = reader.I32(), column = reader.I32();
    const std::string text = Printable(reader.Rest());
    if (!reader.ok()) return;
    update->is_error = update->is_exception = true;
    update->message = absl::StrCat("line ", line, ", column ", column, ": ", text);
  }
}

}  // namespace

absl::StatusOr<std::optional<PrimaryUpdate>> PrimaryStream::Next() {
  BigEndianReader reader(bytes_);
  if (bytes_.size() < kHeaderBytes) return std::optional<PrimaryUpdate>();
  const uint32_t size = reader.U32();
  if (size < kHeaderBytes || size > kLargestBytes)
    return absl::DataLossError(absl::StrCat("the primary interface sends a package of ", size, " bytes"));
  if (bytes_.size() < size) return std::optional<PrimaryUpdate>();
  const uint8_t type = reader.U8();
  PrimaryUpdate update;
  const BigEndianReader body(reader.Bytes(size - kHeaderBytes));
  if (type == kState) TOUCHSTONE_RETURN_IF_ERROR(ParseState(body, &update));
  if (type == kMessage) ParseMessage(body, &update);
  bytes_.erase(0, size);
  return std::optional<PrimaryUpdate>(std::move(update));
}

}  // namespace touchstone::gateway::arm
