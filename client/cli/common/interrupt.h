// SIGINT and SIGTERM as an orderly end: the first one calls what the running command has asked for, or ends
// the process if there is nothing; the second one ends the process at once.
#pragma once

#include <functional>

namespace touchstone::cli {

class Interrupt {
 public:
  // Once: from then on a thread of its own waits for the signals. An ignored SIGINT, which is what a shell gives to
  // programs in the background, stays ignored.
  static void Install();

  // True once a signal has come.
  static bool Raised();

  // While it lives, the first signal calls `on_signal`, from another thread.
  class Handler {
   public:
    explicit Handler(std::function<void()> on_signal);
    ~Handler();
    Handler(const Handler&) = delete;
    Handler& operator=(const Handler&) = delete;
  };
};

}  // namespace touchstone::cli
