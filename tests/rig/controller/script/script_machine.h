// Runs a compiled script: cooperative threads that go on until each waits for time, a motion,
// or another thread.
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tests/rig/controller/script/script_program.h"

namespace touchstone::rig {

// What a function of the controller answers to its script.
struct Outcome {
  enum class Wait {
    kNone,   // `value` is its result
    kUntil,  // a time, then None
    kCycle,  // the next control cycle, then None
    kRest,   // the motion that it began has ended
    kRetry,  // called again with the same arguments once the arm rests
  };
  Wait wait = Wait::kNone;
  Value value;
  double until_s = 0;
};

// The arm and the registers, as a script sees them.
class ScriptHost {
 public:
  virtual ~ScriptHost() = default;
  // Function `index` of Builtins(), called by thread `thread`. Throws ScriptError.
  virtual Outcome CallBuiltin(int index, const std::vector<Value>& arguments, int thread) = 0;
  virtual bool Resting() const = 0;
};

class ScriptMachine {
 public:
  ScriptMachine(ScriptProgram program, ScriptHost* host, double cycle_s);

  struct Failure {
    std::string what;
    int line, column;
  };
  // Lets every thread that may go on do so at `now_s`; false once the program has ended. Failure():
  // it ended so.
  bool Run(double now_s);
  const std::optional<Failure>& failure() const { return failure_; }
  // When a thread waits for a time: the earliest. Infinite: none does.
  double NextWakeS() const;   // of sleeps
  double NextCycleS() const;  // of threads that wait for a control cycle
  // Threads that wait for a control cycle and would go on before this time go on then.
  void SkipCyclesTo(double time_s);
  bool WaitsForRest() const;
  // That thread exists and has not ended.
  bool Lives(int thread) const;
  const ScriptProgram& program() const { return program_; }
  int line() const { return line_; }  // where it was last

 private:
  struct Frame {
    int function, at;
    std::vector<Value> locals;
    std::vector<bool> set;
    size_t stack_base;
  };
  struct Thread {
    int id;
    std::vector<Frame> frames;
    std::vector<Value> stack;
    Outcome::Wait wait = Outcome::Wait::kNone;
    double until_s = 0;
    int joins = -1;
    bool ended = false;
  };

  void Begin(int function, std::vector<Value> arguments);
  bool MayGoOn(const Thread& thread, double now_s) const;
  void Execute(Thread& thread, double now_s);
  // One instruction; false: the thread waits, has ended, or the program is halted.
  bool Step(Thread& thread, const Instruction& code, double now_s);
  void AccessVariable(Thread& thread, const Instruction& code);
  void Call(Thread& thread, const Instruction& code);
  bool CallBuiltin(Thread& thread, const Instruction& code, double now_s);
  bool KillOrJoin(Thread& thread, Op op);
  bool Return(Thread& thread);
  void MakeList(Thread& thread, const Instruction& code);
  void TakeItem(Thread& thread);
  void Calculate(Thread& thread, Op op);
  Value Pop(Thread& thread);

  ScriptProgram program_;
  ScriptHost* host_;
  double cycle_s_;
  std::vector<std::unique_ptr<Thread>> threads_;  // 0: the program
  int begun_ = 0;
  std::vector<Value> globals_;
  std::vector<bool> globals_set_;
  bool halted_ = false;
  int line_ = 0, column_ = 0;
  std::optional<Failure> failure_;
};

}  // namespace touchstone::rig
