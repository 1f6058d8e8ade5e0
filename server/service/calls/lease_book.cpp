#include "server/service/calls/lease_book.h"

#include <absl/strings/str_cat.h>
#include <openssl/rand.h>

#include "server/base/status.h"
#include "server/base/text/printable.h"

namespace touchstone::service {
namespace {

// 128 random bits: a token cannot be guessed.
std::string NewToken() {
  unsigned char bytes[16];
  RAND_bytes(bytes, sizeof bytes);
  std::string token;
  for (unsigned char byte : bytes) absl::StrAppend(&token, absl::Hex(byte, absl::kZeroPad2));
  return token;
}

}  // namespace

bool LeaseBook::Held() const {
  return !token_.empty() && clock_.Now() < until_;
}

v1::Lease LeaseBook::Describe() const {
  v1::Lease lease;
  lease.set_token(token_);
  lease.set_holder(holder_);
  lease.set_epoch(epoch_);
  lease.set_window_s(window_s_);
  return lease;
}

absl::StatusOr<v1::Lease> LeaseBook::Acquire(const std::string& holder, bool take, const Caller& caller) {
  if (holder.empty() || holder.size() > kMaxHolderBytes || !IsPrintableLine(holder))
    return absl::InvalidArgumentError(absl::StrCat("holder: say who asks, in 1 to ", kMaxHolderBytes,
                                                   " printable bytes, for instance 'ana@bench2'"));
  std::lock_guard<std::mutex> lock(mutex_);
  if (Held() && !take)
    return absl::FailedPreconditionError(
        absl::StrCat("the lease is held by '", holder_, "' (epoch ", epoch_,
                     "): ask them to release it, or take it with take = true"));
  token_ = NewToken();
  holder_ = WithCaller(holder, caller);
  ++epoch_;
  until_ = clock_.In(window_s_);
  return Describe();
}

absl::Status LeaseBook::CheckToken(const std::string& token) const {
  const bool held = Held();
  if (held && token == token_) return absl::OkStatus();
  return absl::AbortedError(
      held ? absl::StrCat("this lease is stale: '", holder_, "' holds epoch ", epoch_, " now")
           : std::string("this lease is stale: it ran out, was released, or ended with the reset of a "
                         "stop; acquire a new one"));
}

absl::StatusOr<v1::Lease> LeaseBook::Renew(const std::string& token) {
  std::lock_guard<std::mutex> lock(mutex_);
  TOUCHSTONE_RETURN_IF_ERROR(CheckToken(token));
  until_ = clock_.In(window_s_);
  return Describe();
}

absl::Status LeaseBook::Release(const std::string& token) {
  std::lock_guard<std::mutex> lock(mutex_);
  TOUCHSTONE_RETURN_IF_ERROR(CheckToken(token));
  token_.clear();
  holder_.clear();
  return absl::OkStatus();
}

void LeaseBook::Revoke() {
  std::lock_guard<std::mutex> lock(mutex_);
  token_.clear();
  holder_.clear();
}

absl::Status LeaseBook::Check(const std::string& token) const {
  if (token.empty() && !required_) return absl::OkStatus();
  if (token.empty())
    return absl::FailedPreconditionError(
        "lease_token is missing: this source moves things, so it needs a lease from Control.AcquireLease");
  std::lock_guard<std::mutex> lock(mutex_);
  return CheckToken(token);
}

std::string LeaseBook::Holder() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return Held() ? holder_ : "";
}

uint64_t LeaseBook::epoch() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return epoch_;
}

}  // namespace touchstone::service
