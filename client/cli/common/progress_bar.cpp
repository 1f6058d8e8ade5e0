#include "client/cli/common/progress_bar.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include "server/base/text/text.h"

namespace touchstone::cli {
namespace {

constexpr size_t kBarWidth = 30, kMinBarWidth = 10;
constexpr size_t kColumnsOfNoTerminal = 110;
constexpr double kMinShare = 0.01, kMinElapsedS = 1;  // less tells nothing of the rest

ProgressBar::Output Stderr() {
  using std::chrono::milliseconds;
  const bool terminal = ::isatty(STDERR_FILENO) != 0;
  return terminal ? ProgressBar::Output{stderr, true, milliseconds(500), milliseconds(200)}
                  : ProgressBar::Output{stderr, false, milliseconds(10'000), milliseconds(10'000)};
}

size_t ColumnsOf(std::FILE* file) {
  winsize size{};
  if (::ioctl(::fileno(file), TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return kColumnsOfNoTerminal;
  return size.ws_col;
}

std::string LeftInWords(const Progress& progress) {
  return progress.left_s < 0 ? "" : DurationInWords(progress.left_s) + " left";
}

// Bars that may be shown, and a lock for the list.
std::mutex& BarsMutex() {
  static std::mutex mutex;
  return mutex;
}
std::vector<ProgressBar*>& Bars() {
  static std::vector<ProgressBar*> bars;
  return bars;
}

}  // namespace

double SecondsLeft(double share, double begun_at, double elapsed_s) {
  const double made = share - begun_at;
  if (share < 0 || made < kMinShare || elapsed_s < kMinElapsedS) return -1;
  return elapsed_s * (1 - share) / made;
}

std::string ProgressInPlace(const Progress& progress, double elapsed_s, size_t width) {
  std::vector<std::string> parts;
  if (progress.share >= 0) {
    const double share = std::clamp(progress.share, 0.0, 1.0);
    const size_t bar = width < kColumnsOfNoTerminal ? kMinBarWidth : kBarWidth;
    const auto filled = static_cast<size_t>(share * static_cast<double>(bar));
    parts.push_back(absl::StrFormat("[%s%s] %5.1f %%", std::string(filled, '#'),
                                    std::string(bar - filled, '.'), 100 * share));
  } else {
    parts.push_back(absl::StrCat(DurationInWords(std::floor(elapsed_s)), " so far"));
  }
  for (const std::string& part : {progress.counts, LeftInWords(progress), progress.stage})
    if (!part.empty()) parts.push_back(part);
  std::string line = absl::StrJoin(parts, "  ");
  // A line that the terminal breaks cannot be wiped.
  if (line.size() >= width) line.resize(width - 1);
  return line;
}

std::string ProgressLine(const Progress& progress, double elapsed_s) {
  const std::string after = absl::StrCat("after ", DurationInWords(std::floor(elapsed_s)));
  std::vector<std::string> parts = {
      progress.share < 0 ? after
                         : absl::StrFormat("%.0f %% %s", 100 * std::clamp(progress.share, 0.0, 1.0), after)};
  for (const std::string& part : {progress.counts, LeftInWords(progress)})
    if (!part.empty()) parts.push_back(part);
  return absl::StrCat(absl::StrJoin(parts, ", "), progress.stage.empty() ? "" : ": ", progress.stage);
}

ProgressBar::ProgressBar(bool enabled) : ProgressBar(enabled, Stderr()) {}

ProgressBar::ProgressBar(bool enabled, Output output)
    : enabled_(enabled), output_(output), next_(start_ + output.first) {
  if (!enabled_) return;
  ClearShown();
  const std::lock_guard<std::mutex> lock(BarsMutex());
  Bars().push_back(this);
}

ProgressBar::~ProgressBar() {
  {
    const std::lock_guard<std::mutex> lock(BarsMutex());
    Bars().erase(std::remove(Bars().begin(), Bars().end(), this), Bars().end());
  }
  Clear();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ended_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void ProgressBar::Show(uint64_t done, uint64_t total, uint64_t this_run, absl::string_view things) {
  if (total == 0) return;
  Progress progress;
  const double elapsed_s = std::chrono::duration<double>(Clock::now() - start_).count();
  const double rate = elapsed_s > 0 ? static_cast<double>(this_run) / elapsed_s : 0;
  progress.share = static_cast<double>(done) / static_cast<double>(total);
  progress.counts = absl::StrCat(done, " of ", total, " ", things);
  if (rate > 0) {
    absl::StrAppendFormat(&progress.counts, "  %.*f %s/s", rate < 10 ? 1 : 0, rate, std::string(things));
    progress.left_s = static_cast<double>(total - done) / rate;
  }
  Set(std::move(progress));
}

void ProgressBar::ShowStage(const std::string& stage, double share) {
  Progress progress;
  progress.stage = stage;
  progress.share = share;
  Set(std::move(progress));
}

void ProgressBar::SetPart(const std::string& before, double from, double to) {
  const std::lock_guard<std::mutex> lock(mutex_);
  part_ = before, part_from_ = from, part_to_ = to;
}

void ProgressBar::Set(Progress progress) {
  if (!enabled_) return;
  const Clock::time_point now = Clock::now();
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!part_.empty()) {
    progress.stage = absl::StrCat(part_, progress.stage.empty() ? "" : ", ", progress.stage);
    progress.share = part_from_ + (part_to_ - part_from_) * std::max(progress.share, 0.0);
  }
  // While the share stays as it is, so does the moment at which the rest should be done.
  const double elapsed_s = std::chrono::duration<double>(now - start_).count();
  if (begun_at_ < 0) begun_at_ = progress.share;
  if (progress.share != progress_.share) {
    const double left_s =
        progress.left_s >= 0 ? progress.left_s : SecondsLeft(progress.share, begun_at_, elapsed_s);
    ends_at_s_ = left_s < 0 ? -1 : elapsed_s + left_s;
  }
  progress_ = std::move(progress);
  showing_ = true;
  if (now >= next_) Draw(now);
  if (!thread_.joinable())
    thread_ = std::thread([this] { Run(); });
  else
    changed_.notify_all();
}

// With mutex_.
void ProgressBar::Draw(Clock::time_point now) {
  const double elapsed_s = std::chrono::duration<double>(now - start_).count();
  next_ = now + output_.interval;
  Progress progress = progress_;
  progress.left_s = ends_at_s_ > elapsed_s ? ends_at_s_ - elapsed_s : -1;
  if (output_.terminal) {
    std::fprintf(output_.file, "\r\x1b[K%s",
                 ProgressInPlace(progress, elapsed_s, ColumnsOf(output_.file)).c_str());
    drawn_ = true;
  } else {
    std::fprintf(output_.file, "%s\n", ProgressLine(progress, elapsed_s).c_str());
  }
  std::fflush(output_.file);
}

void ProgressBar::Run() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!ended_) {
    if (!showing_)
      changed_.wait(lock);
    else if (changed_.wait_until(lock, next_) == std::cv_status::timeout && showing_ && !ended_)
      Draw(Clock::now());
  }
}

void ProgressBar::ClearShown() {
  const std::lock_guard<std::mutex> lock(BarsMutex());
  for (ProgressBar* bar : Bars()) bar->Clear();
}

void ProgressBar::Clear() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (drawn_) std::fprintf(output_.file, "\r\x1b[K");
  if (drawn_) std::fflush(output_.file);
  drawn_ = showing_ = false;
}

}  // namespace touchstone::cli
