#include "tests/rig/controller/script/script_machine.h"

#include <algorithm>
#include <cmath>

#include "tests/rig/controller/never.h"
namespace touchstone::rig {
namespace {}  // namespace

ScriptMachine::ScriptMachine(ScriptProgram program, ScriptHost* host, double cycle_s)
    : program_(std::move(program)), host_(host), cycle_s_(cycle_s) {
  globals_.resize(program_.globals.size());
  globals_set_.resize(program_.globals.size());
  Begin(0, {});
}

void ScriptMachine::Begin(int function, std::vector<Value> arguments) {
  auto thread = std::make_unique<Thread>();
  thread->id = begun_++;
  const size_t locals = program_.functions[function].locals.size();
  Frame frame{function, 0, std::move(arguments), {}, 0};
  frame.set.assign(locals, false);
  for (size_t i = 0; i < frame.locals.size(); ++i) frame.set[i] = true;
  frame.locals.resize(locals);
  thread->frames.push_back(std::move(frame));
  threads_.push_back(std::move(thread));
}

bool ScriptMachine::Lives(int thread) const {
  for (const auto& each : threads_)
    if (each->id == thread) return !each->ended;
  return false;
}

bool ScriptMachine::MayGoOn(const Thread& thread, double now_s) const {
  if (thread.ended) return false;
  if (thread.joins >= 0 && Lives(thread.joins)) return false;
  switch (thread.wait) {
    case Outcome::Wait::kNone:
      return true;
    case Outcome::Wait::kUntil:
    case Outcome::Wait::kCycle:
      return now_s >= thread.until_s;
    case Outcome::Wait::kRest:
    case Outcome::Wait::kRetry:
      return host_->Resting();
  }
  return false;
}

bool ScriptMachine::Run(double now_s) {
  // A thread that ends or is killed may free another that joins it: goes round until nobody can go on.
  bool again = true;
  while (again && !halted_) {
    again = false;
    for (size_t i = 0; i < threads_.size() && !halted_; ++i) {
      if (!MayGoOn(*threads_[i], now_s)) continue;
      Execute(*threads_[i], now_s);
      again = true;
    }
    if (threads_[0]->ended) halted_ = true;
    for (size_t i = threads_.size(); i-- > 1;)
      if (threads_[i]->ended) threads_.erase(threads_.begin() + i);
  }
  return !halted_;
}

double ScriptMachine::NextWakeS() const {
  double next = kNever;
  for (const auto& thread : threads_)
    if (!thread->ended && thread->wait == Outcome::Wait::kUntil) next = std::min(next, thread->until_s);
  return next;
}

double ScriptMachine::NextCycleS() const {
  double next = kNever;
  for (const auto& thread : threads_)
    if (!thread->ended && thread->wait == Outcome::Wait::kCycle) next = std::min(next, thread->until_s);
  return next;
}

void ScriptMachine::SkipCyclesTo(double time_s) {
  for (const auto& thread : threads_)
    if (thread->wait == Outcome::Wait::kCycle) thread->until_s = std::max(thread->until_s, time_s);
}

bool ScriptMachine::WaitsForRest() const {
  for (const auto& thread : threads_)
    if (!thread->ended && (thread->wait == Outcome::Wait::kRest || thread->wait == Outcome::Wait::kRetry))
      return true;
  return false;
}

}  // namespace touchstone::rig
