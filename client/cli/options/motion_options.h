// What the commands share that may move a real arm: --take-lease and --session, and the source with its
// lease. Nothing of it shows at a virtual source.
#pragma once

#include <memory>
#include <string>

#include "client/cli/common/common.h"
#include "client/cli/common/interrupt.h"
#include "client/source/connection/leased_source.h"

namespace touchstone::cli {

struct MotionFlags {
  bool take_lease = false;
  std::string session;  // empty: the command's default
};
// --take-lease and, if `session`, --session.
void AddMotionOptions(CLI::App* command, MotionFlags* flags, bool session);

// The source behind `connection`, with its lease if it needs one. The parts of a rig that is starting are waited for,
// up to --wait-s. `log` may be null: cli.Log then.
absl::StatusOr<std::unique_ptr<client::LeasedSource>> OpenLeased(
    const Cli& cli, client::Connection* connection, const MotionFlags& flags,
    std::function<void(const std::string&)> log = nullptr);

// While it lives, Ctrl-C stops the motion first and then ends the command.
class StopOnInterrupt {
 public:
  explicit StopOnInterrupt(client::LeasedSource* source)
      : handler_([source] { source->Interrupt("interrupted at the command line"); }) {}

 private:
  Interrupt::Handler handler_;
};

// Asks a person to do something and waits for Enter. CANCELLED if interrupted; FAILED_PRECONDITION if
// stdin has ended.
absl::Status AskPerson(const std::string& what);

}  // namespace touchstone::cli
