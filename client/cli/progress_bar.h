// A progress bar on stderr, only where a person looks at it.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace touchstone::cli {

class ProgressBar {
 public:
  // `enabled` false or stderr not a terminal: nothing is drawn.
  explicit ProgressBar(bool enabled);
  ~ProgressBar() { Clear(); }

  // `done` of `total` samples; `this_run` of them were made since the bar began, which gives the rate.
  void Show(uint64_t done, uint64_t total, uint64_t this_run);
  // `share` from 0 to 1 of a work whose present stage has a name.
  void ShowStage(const std::string& stage, double share);
  // Wipes the line, so that other text may be written.
  void Clear();

 private:
  using Clock = std::chrono::steady_clock;
  bool enabled_;
  bool drawn_ = false;
  Clock::time_point start_ = Clock::now();
  Clock::time_point next_ = start_;
};

}  // namespace touchstone::cli
