#include "server/service/connections/certificate_stamp.h"

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>
#include <openssl/rand.h>

#include <algorithm>
#include <optional>

#include "server/service/connections/frame_reader.h"

namespace touchstone::service {
namespace {

constexpr size_t kMaxNamesBytes = 2048;  // headers have a limit of 8 KiB together

// An integer of RFC 7541, 5.1, with a prefix of seven bits.
std::string IntegerOf(size_t number) {
  constexpr size_t kPrefix = 127;
  if (number < kPrefix) return {static_cast<char>(number)};
  std::string text(1, static_cast<char>(kPrefix));
  for (number -= kPrefix; number >= 128; number /= 128) text.push_back(static_cast<char>(number % 128 + 128));
  text.push_back(static_cast<char>(number));
  return text;
}

// A header that is never indexed (RFC 7541, 6.2.3), and so leaves alone what the client refers to.
std::string HeaderOf(absl::string_view name, absl::string_view value) {
  return absl::StrCat("\x10", IntegerOf(name.size()), name, IntegerOf(value.size()), value);
}

class StampedWire final : public Wire {
 public:
  explicit StampedWire(std::unique_ptr<Wire> wire) : wire_(std::move(wire)) {}

  Moved Read(char* to, size_t size) override {
    while (ready_.empty()) {
      char read[4096];
      const Moved moved = wire_->Read(read, sizeof read);
      if (moved.state != State::kMoved) return moved;
      if (!header_.has_value()) {
        const std::vector<std::string> names = wire_->CertificateNames();
        header_ = names.empty() ? "" : HeaderOf(StampName(), StampOf(names));
      }
      Stamp({read, moved.bytes});
    }
    const size_t bytes = std::min(size, ready_.size());
    ready_.copy(to, bytes);
    ready_.erase(0, bytes);
    return {State::kMoved, bytes};
  }
  Moved Write(absl::string_view bytes) override { return wire_->Write(bytes); }
  bool buffered() const override { return !ready_.empty() || wire_->buffered(); }
  bool reads_when_writable() const override { return wire_->reads_when_writable(); }

 private:
  // The bytes, whose last frame of headers of each call is followed by one more.
  void Stamp(absl::string_view bytes) {
    if (header_->empty()) {
      ready_.append(bytes.data(), bytes.size());
      return;
    }
    waiting_.append(bytes.data(), bytes.size());
    size_t copied = 0;
    const auto admit = [&](const FrameHead& head, absl::string_view payload) {
      const bool last = (head.type == FrameType::kHeaders || head.type == FrameType::kContinuation) &&
                        head.Has(kEndHeaders);
      if (!last) return true;
      if (payload.size() < head.length) return false;
      const size_t at = payload.data() - waiting_.data();
      ready_.append(waiting_, copied, at - FrameHead::kBytes - copied);
      FrameHead open = head;
      open.flags &= static_cast<uint8_t>(~kEndHeaders);
      absl::StrAppend(&ready_, FrameOf(open, payload),
                      FrameOf({0, FrameType::kContinuation, kEndHeaders, head.stream}, *header_));
      copied = at + payload.size();
      return true;
    };
    const size_t passed = reader_.Pass(waiting_, admit);
    if (passed > copied) ready_.append(waiting_, copied, passed - copied);
    waiting_.erase(0, passed);
  }

  const std::unique_ptr<Wire> wire_;
  std::optional<std::string> header_;  // empty: there is no certificate; not known before the first bytes
  FrameReader reader_{kClientPreface.size()};
  std::string waiting_, ready_;
};

}  // namespace

const std::string& StampName() {
  static const std::string name = [] {
    unsigned char bytes[16];
    RAND_bytes(bytes, sizeof bytes);
    return "x-touchstone-certificate-" +
           absl::BytesToHexString({reinterpret_cast<const char*>(bytes), sizeof bytes});
  }();
  return name;
}

std::string StampOf(const std::vector<std::string>& certificate_names) {
  std::string names;
  for (const std::string& name : certificate_names)
    if (names.size() + name.size() < kMaxNamesBytes)
      absl::StrAppend(&names, names.empty() ? "" : ",", absl::BytesToHexString(name));
  return names;
}

std::vector<std::string> NamesOfStamp(absl::string_view stamp) {
  std::vector<std::string> names;
  for (const absl::string_view name : absl::StrSplit(stamp, ',', absl::SkipEmpty()))
    names.push_back(absl::HexStringToBytes(name));
  return names;
}

std::unique_ptr<Wire> Stamped(std::unique_ptr<Wire> wire) {
  return std::make_unique<StampedWire>(std::move(wire));
}

}  // namespace touchstone::service
