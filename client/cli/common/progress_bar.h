// How far a command is, on stderr: on a terminal one line that is drawn in place, elsewhere a line every ten seconds. What is
// done at once shows nothing.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <cstdio>
#include <mutex>
#include <string>
#include <thread>

#include <absl/strings/string_view.h>

namespace touchstone::cli {

// What is known of a work that takes a while.
struct Progress {
  std::string stage;   // what is being done now; may be empty
  double share = -1;   // of the whole work that is done, 0 to 1; below 0: unknown
  std::string counts;  // "12 of 40 samples"; may be empty
  double left_s = -1;  // below 0: unknown
};

// Seconds until the rest is done if it goes on as until now; -1 where that cannot be told yet. `share` counts from `begun_at`,
// what was done before `elapsed_s` began.
double SecondsLeft(double share, double begun_at, double elapsed_s);

// "[###...] 12.5 %  5 of 40 samples  1 min 3 s left  fitting tip_radius", cut after `width` columns.
std::string ProgressInPlace(const Progress& progress, double elapsed_s, size_t width);
// "12 % after 20 s, 5 of 40 samples, 2 min 20 s left: fitting tip_radius".
std::string ProgressLine(const Progress& progress, double elapsed_s);

// Any thread may call it. A thread of its own draws while the work goes on without a word. Of several bars one is shown: a new
// one clears the others until their next Show.
class ProgressBar {
 public:
  struct Output {
    std::FILE* file;
    bool terminal;                       // drawn in place
    std::chrono::milliseconds first;     // nothing before it
    std::chrono::milliseconds interval;  // between two drawings or lines
  };

  // On stderr; `enabled` false: nothing is shown.
  explicit ProgressBar(bool enabled);
  ProgressBar(bool enabled, Output output);
  ~ProgressBar();

  // `done` of `total` things; `this_run` of them were done since the bar began, which gives the rate.
  void Show(uint64_t done, uint64_t total, uint64_t this_run, absl::string_view things = "samples");
  // `share` from 0 to 1 of a work whose present stage has a name; below 0: nobody knows how much is left.
  void ShowStage(const std::string& stage, double share = -1);
  // From now on stages are a part of a larger work: `before` stands before their names, and their shares are of `from` to `to`.
  void SetPart(const std::string& before, double from, double to);
  // Wipes the line, so that other text may be written, and shows nothing until the next Show.
  void Clear();
  // The same of the bar that is shown, whichever it is: before any text is written.
  static void ClearShown();

 private:
  using Clock = std::chrono::steady_clock;
  void Set(Progress progress);
  void Draw(Clock::time_point now);
  void Run();

  const bool enabled_;
  const Output output_;
  const Clock::time_point start_ = Clock::now();
  std::mutex mutex_;
  std::condition_variable changed_;
  Progress progress_;
  std::string part_;
  double part_from_ = 0, part_to_ = 1;
  double begun_at_ = -1;   // share of the first stage
  double ends_at_s_ = -1;  // seconds since start_; below 0: unknown
  bool showing_ = false, drawn_ = false, ended_ = false;
  Clock::time_point next_;
  std::thread thread_;
};

}  // namespace touchstone::cli
