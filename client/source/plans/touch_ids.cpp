#include "client/source/plans/touch_ids.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>

#include <filesystem>
#include <random>

#include "server/base/text/text.h"

namespace touchstone::client {
namespace {

constexpr size_t kMaxIdBytes = 128;
constexpr size_t kMaxSessionBytes = 64;
constexpr size_t kHashDigits = 16;

bool IsNameCharacter(char c) {
  return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '.' || c == '-';
}

}  // namespace

std::string TouchId(const std::string& session, const std::string& object, uint64_t number) {
  const std::string id = absl::StrCat(session, "/", object, "/", number);
  if (id.size() <= kMaxIdBytes) return id;
  // An object's name may be long: its hash stands for it.
  return absl::StrCat(session, "/", Sha256Hex(object).substr(0, kHashDigits), "/", number);
}

std::string NewTouchId(uint64_t number) {
  static const std::string once = [] {
    std::random_device random;
    return absl::StrCat(absl::Hex(random(), absl::kZeroPad8), absl::Hex(random(), absl::kZeroPad8),
                        absl::Hex(random(), absl::kZeroPad8), absl::Hex(random(), absl::kZeroPad8));
  }();
  return absl::StrCat("new/", once, "/", number);
}

absl::Status CheckSessionName(const std::string& name, const std::string& where) {
  bool good = !name.empty() && name.size() <= kMaxSessionBytes;
  for (const char c : name) good = good && IsNameCharacter(c);
  if (good) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      where, ": '", name, "' is no session's name: 1 to 64 letters, digits, '_', '-' and '.' were expected"));
}

std::string SessionNameOf(const std::string& path) {
  std::string name = std::filesystem::path(path).stem().string().substr(0, kMaxSessionBytes);
  for (char& c : name)
    if (!IsNameCharacter(c)) c = '-';
  return name.empty() ? "default" : name;
}

}  // namespace touchstone::client
