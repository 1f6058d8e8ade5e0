// What a report's errors are measured in: times of touches (us), or grey levels of photographs. A joint report of both
// tells its ladder in grey levels, since every picture has thousands of readings.
#pragma once

#include <string>

#include "client/report/words.h"

namespace touchstone::client {

class ErrorScale {
 public:
  explicit ErrorScale(const v1::Report& report) : grey_(report.images() > 0) {}

  bool grey() const { return grey_; }
  const char* readings() const { return grey_ ? "pictures" : "touches"; }
  const char* one_reading() const { return grey_ ? "picture" : "touch"; }
  uint32_t Readings(const v1::Report& report) const { return grey_ ? report.images() : report.touches(); }
  uint32_t Readings(const v1::Slice& slice) const { return grey_ ? slice.images() : slice.touches(); }
  uint32_t Readings(const v1::GroupError& group) const { return grey_ ? group.images() : group.touches(); }

  // Of a quality, a step, a candidate, a slice, a group or what is unexplained; 0: none.
  template <typename Message>
  double Rmse(const Message& m) const {
    return grey_ ? m.rmse_grey() : m.rmse_us();
  }
  template <typename Message>
  double Heldout(const Message& m) const {
    return grey_ ? m.heldout_rmse_grey() : m.heldout_rmse_us();
  }
  // On readings that the fit did not see; where none was found, on those that it saw.
  template <typename Message>
  double Unseen(const Message& m) const {
    return UnseenError(Heldout(m), Rmse(m));
  }
  template <typename Message>
  double Mean(const Message& m) const {
    return grey_ ? m.mean_residual_grey() : m.mean_residual_us();
  }
  double StdError(const v1::CurveBin& bin) const { return grey_ ? bin.std_error_grey() : bin.std_error_us(); }
  double After(const v1::CurveBin& bin) const { return grey_ ? bin.after_grey() : bin.after_us(); }
  double Before(const v1::DataProblem& p) const { return grey_ ? p.rmse_before_grey() : p.rmse_before_us(); }
  double After(const v1::DataProblem& p) const { return grey_ ? p.rmse_after_grey() : p.rmse_after_us(); }

  std::string Text(double error) const;              // "41.0 ms", "12.3 grey"
  std::string Signed(double error) const;            // "+9.10 ms", "-3.20 grey"
  std::string Change(double from, double to) const;  // "41.0 -> 5.0 ms", "12.3 -> 2.1 grey"

 private:
  bool grey_;
};

}  // namespace touchstone::client
