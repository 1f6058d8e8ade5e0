#include "client/cli/progress_bar.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <string>

#include "server/base/text.h"

namespace touchstone::cli {
namespace {

constexpr int kBarWidth = 30;
constexpr std::chrono::milliseconds kInterval{100};

}  // namespace

ProgressBar::ProgressBar(bool enabled) : enabled_(enabled && ::isatty(STDERR_FILENO) != 0) {}

void ProgressBar::Show(uint64_t done, uint64_t total, uint64_t this_run) {
  const Clock::time_point now = Clock::now();
  if (!enabled_ || now < next_ || total == 0) return;
  next_ = now + kInterval;
  const double elapsed_s = std::chrono::duration<double>(now - start_).count();
  const double rate = elapsed_s > 0 ? this_run / elapsed_s : 0;
  const double share = static_cast<double>(done) / total;
  const int filled = static_cast<int>(share * kBarWidth);
  const std::string bar = std::string(filled, '#') + std::string(kBarWidth - filled, '.');
  const std::string left = rate > 0 ? DurationInWords((total - done) / rate) + " left" : "";
  std::fprintf(stderr, "\r\x1b[K[%s] %5.1f %%  %llu of %llu samples  %.0f samples/s  %s", bar.c_str(),
               100 * share, static_cast<unsigned long long>(done), static_cast<unsigned long long>(total),
               rate, left.c_str());
  std::fflush(stderr);
  drawn_ = true;
}

void ProgressBar::ShowStage(const std::string& stage, double share) {
  const Clock::time_point now = Clock::now();
  if (!enabled_ || now < next_) return;
  next_ = now + kInterval;
  const int filled = static_cast<int>(std::min(std::max(share, 0.0), 1.0) * kBarWidth);
  const std::string bar = std::string(filled, '#') + std::string(kBarWidth - filled, '.');
  std::fprintf(stderr, "\r\x1b[K[%s] %3.0f %%  %s", bar.c_str(), 100 * share, stage.c_str());
  std::fflush(stderr);
  drawn_ = true;
}

void ProgressBar::Clear() {
  if (drawn_) std::fprintf(stderr, "\r\x1b[K");
  drawn_ = false;
}

}  // namespace touchstone::cli
