// How the errors of one kind of measurement are written: times (us), grey levels or pixels, and what is counted.
#pragma once

#include <string>

#include "client/report/words/words.h"

namespace touchstone::client {

class ErrorScale {
 public:
  explicit ErrorScale(const v1::DataReport& data) : kind_(data.kind()) {}

  v1::DataReport::Kind kind() const { return kind_; }
  bool pictures() const { return kind_ == v1::DataReport::PHOTOGRAPHS || kind_ == v1::DataReport::BOARDS; }
  const char* readings() const { return pictures() ? "pictures" : "touches"; }
  const char* one_reading() const { return pictures() ? "picture" : "touch"; }
  const char* Counted(uint32_t count) const { return count == 1 ? one_reading() : readings(); }

  std::string Text(double error) const;              // "41.0 ms", "12.3 grey", "0.123 px"
  std::string Signed(double error) const;            // "+9.10 ms", "-3.20 grey"
  std::string Change(double from, double to) const;  // "41.0 -> 5.0 ms", "12.3 -> 2.1 grey"

  // The unit that fits errors of this size on an axis, and the factor that brings them into it.
  TimeUnit UnitFor(double size) const;

 private:
  bool IsTime() const { return !pictures(); }
  std::string Plain(double error) const;
  const char* Symbol() const;

  v1::DataReport::Kind kind_;
};

// On measurements that the fit did not see; where none was found, on those that it saw. Of whatever has both errors.
template <typename Message>
double UnseenError(const Message& message) {
  return message.heldout_rmse() > 0 ? message.heldout_rmse() : message.rmse();
}

}  // namespace touchstone::client
