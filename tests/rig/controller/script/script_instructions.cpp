// What each instruction of a program does.
#include <algorithm>
#include <cmath>

#include "tests/rig/controller/script/script_machine.h"

namespace touchstone::rig {
namespace {

constexpr int kMaxInstructions = 200000;  // without waiting, in one go: an endless loop
constexpr size_t kMaxFrames = 200, kMaxThreads = 50, kMaxItems = 10000;

}  // namespace

Value ScriptMachine::Pop(Thread& thread) {
  if (thread.stack.empty()) throw ScriptError("the stack is empty");
  Value value = std::move(thread.stack.back());
  thread.stack.pop_back();
  return value;
}

void ScriptMachine::Execute(Thread& thread, double now_s) {
  thread.wait = Outcome::Wait::kNone;
  thread.joins = -1;
  try {
    for (int count = 0;; ++count) {
      Frame& frame = thread.frames.back();
      const Instruction code = program_.functions[frame.function].code[frame.at];
      line_ = code.line;
      column_ = code.column;
      if (count > kMaxInstructions)
        throw ScriptError("infinite loop: the thread does not wait, e.g. with sync()");
      ++frame.at;
      if (!Step(thread, code, now_s)) return;
      if (thread.stack.size() > kMaxItems) throw ScriptError("too many values");
    }
  } catch (const ScriptError& error) {
    failure_ = Failure{error.what(), line_, column_};
    halted_ = true;
  }
}

bool ScriptMachine::Step(Thread& thread, const Instruction& code, double now_s) {
  switch (code.op) {
    case Op::kConstant:
      thread.stack.push_back(program_.constants[code.a]);
      return true;
    case Op::kLoadLocal:
    case Op::kStoreLocal:
    case Op::kLoadGlobal:
    case Op::kStoreGlobal:
    case Op::kStoreItemLocal:
    case Op::kStoreItemGlobal:
      AccessVariable(thread, code);
      return true;
    case Op::kJump:
      thread.frames.back().at = code.a;
      return true;
    case Op::kJumpIfFalse:
      if (!Pop(thread).AsBool("a condition")) thread.frames.back().at = code.a;
      return true;
    case Op::kCall:
    case Op::kRun:
      Call(thread, code);
      return true;
    case Op::kBuiltin:
      return CallBuiltin(thread, code, now_s);
    case Op::kKill:
    case Op::kJoin:
      return KillOrJoin(thread, code.op);
    case Op::kReturn:
      return Return(thread);
    case Op::kPop:
      Pop(thread);
      return true;
    case Op::kMakeList:
    case Op::kMakePose:
      MakeList(thread, code);
      return true;
    case Op::kIndex:
      TakeItem(thread);
      return true;
    case Op::kHalt:
      halted_ = true;
      return false;
    default:
      Calculate(thread, code.op);
      return true;
  }
}

void ScriptMachine::AccessVariable(Thread& thread, const Instruction& code) {
  Frame& frame = thread.frames.back();
  switch (code.op) {
    case Op::kLoadLocal:
      if (!frame.set[code.a])
        throw ScriptError("variable '" + program_.functions[frame.function].locals[code.a] +
                          "' has no value yet");
      thread.stack.push_back(frame.locals[code.a]);
      break;
    case Op::kStoreLocal:
      frame.locals[code.a] = Pop(thread);
      frame.set[code.a] = true;
      break;
    case Op::kLoadGlobal:
      if (!globals_set_[code.a])
        throw ScriptError("variable '" + program_.globals[code.a] + "' has no value yet");
      thread.stack.push_back(globals_[code.a]);
      break;
    case Op::kStoreGlobal:
      globals_[code.a] = Pop(thread);
      globals_set_[code.a] = true;
      break;
    default: {  // an item of a list
      Value value = Pop(thread);
      const int index = Pop(thread).AsInteger("an index");
      Value& list = code.op == Op::kStoreItemLocal ? frame.locals[code.a] : globals_[code.a];
      if (index < 0 || index >= static_cast<int>(list.items.size()))
        throw ScriptError("index " + std::to_string(index) + " is out of range");
      list.items[index] = std::move(value);
    }
  }
}

void ScriptMachine::Call(Thread& thread, const Instruction& code) {
  std::vector<Value> arguments(code.b);
  for (int i = code.b; i-- > 0;) arguments[i] = Pop(thread);
  if (code.op == Op::kRun) {
    if (threads_.size() >= kMaxThreads) throw ScriptError("too many threads");
    thread.stack.push_back({Value::Kind::kThread, static_cast<double>(begun_), {}, {}});
    Begin(code.a, std::move(arguments));
    return;
  }
  if (thread.frames.size() >= kMaxFrames) throw ScriptError("calls are nested too deeply");
  const size_t locals = program_.functions[code.a].locals.size();
  Frame next{code.a, 0, std::move(arguments), {}, thread.stack.size()};
  next.set.assign(locals, false);
  for (size_t i = 0; i < next.locals.size(); ++i) next.set[i] = true;
  next.locals.resize(locals);
  thread.frames.push_back(std::move(next));
}

bool ScriptMachine::CallBuiltin(Thread& thread, const Instruction& code, double now_s) {
  const std::vector<Value> arguments(thread.stack.end() - code.b, thread.stack.end());
  Outcome outcome = host_->CallBuiltin(code.a, arguments, thread.id);
  if (outcome.wait == Outcome::Wait::kRetry) {
    --thread.frames.back().at;
    thread.wait = outcome.wait;
    return false;
  }
  thread.stack.resize(thread.stack.size() - code.b);
  thread.stack.push_back(std::move(outcome.value));
  if (outcome.wait == Outcome::Wait::kNone) return true;
  thread.wait = outcome.wait;
  thread.until_s = outcome.until_s;
  // The next cycle, also if rounding makes `now` its own boundary.
  if (outcome.wait == Outcome::Wait::kCycle)
    thread.until_s = std::max(std::floor(now_s / cycle_s_ + 1e-6) + 1, 1.0) * cycle_s_;
  return false;
}

bool ScriptMachine::KillOrJoin(Thread& thread, Op op) {
  const Value handle = Pop(thread);
  if (handle.kind != Value::Kind::kThread) throw ScriptError("kill and join take what run has returned");
  const int id = static_cast<int>(handle.number);
  if (op == Op::kJoin) {
    if (id == thread.id) throw ScriptError("a thread cannot join itself");
    thread.joins = id;
    return !Lives(id);
  }
  for (const auto& each : threads_)
    if (each->id == id) each->ended = true;
  return !thread.ended;
}

bool ScriptMachine::Return(Thread& thread) {
  Value value = Pop(thread);
  thread.stack.resize(thread.frames.back().stack_base);
  thread.frames.pop_back();
  if (thread.frames.empty()) {
    thread.ended = true;
    return false;
  }
  thread.stack.push_back(std::move(value));
  return true;
}

void ScriptMachine::MakeList(Thread& thread, const Instruction& code) {
  const int size = code.op == Op::kMakePose ? 6 : code.a;
  Value list = Value::List(std::vector<Value>(thread.stack.end() - size, thread.stack.end()));
  if (code.op == Op::kMakePose) {
    list.kind = Value::Kind::kPose;
    for (const Value& item : list.items) item.AsNumber("a number of a pose");
  }
  thread.stack.resize(thread.stack.size() - size);
  thread.stack.push_back(std::move(list));
}

void ScriptMachine::TakeItem(Thread& thread) {
  const int index = Pop(thread).AsInteger("an index");
  const Value list = Pop(thread);
  if (list.kind != Value::Kind::kList && list.kind != Value::Kind::kPose)
    throw ScriptError("only lists and poses have items, not " + list.ToText());
  if (index < 0 || index >= static_cast<int>(list.items.size()))
    throw ScriptError("index " + std::to_string(index) + " is out of range");
  thread.stack.push_back(list.items[index]);
}

void ScriptMachine::Calculate(Thread& thread, Op op) {
  const Value right = Pop(thread);
  if (op == Op::kNegate) {
    thread.stack.push_back(Value::Number(-right.AsNumber("what '-' is put before")));
    return;
  }
  if (op == Op::kNot) {
    thread.stack.push_back(Value::Bool(!right.AsBool("what 'not' is put before")));
    return;
  }
  const Value left = Pop(thread);
  const auto numbers = [&](const char* sign) {
    const std::string what = std::string("an operand of '") + sign + "'";
    return std::make_pair(left.AsNumber(what), right.AsNumber(what));
  };
  const auto bools = [&](const char* sign) {
    const std::string what = std::string("an operand of '") + sign + "'";
    return std::make_pair(left.AsBool(what), right.AsBool(what));
  };
  const auto push = [&](Value value) { thread.stack.push_back(std::move(value)); };
  switch (op) {
    case Op::kAnd: {
      const auto [x, y] = bools("and");
      return push(Value::Bool(x && y));
    }
    case Op::kOr: {
      const auto [x, y] = bools("or");
      return push(Value::Bool(x || y));
    }
    case Op::kXor: {
      const auto [x, y] = bools("xor");
      return push(Value::Bool(x != y));
    }
    case Op::kEqual:
      return push(Value::Bool(left == right));
    case Op::kUnequal:
      return push(Value::Bool(!(left == right)));
    case Op::kLess: {
      const auto [x, y] = numbers("<");
      return push(Value::Bool(x < y));
    }
    case Op::kLessEqual: {
      const auto [x, y] = numbers("<=");
      return push(Value::Bool(x <= y));
    }
    case Op::kGreater: {
      const auto [x, y] = numbers(">");
      return push(Value::Bool(x > y));
    }
    case Op::kGreaterEqual: {
      const auto [x, y] = numbers(">=");
      return push(Value::Bool(x >= y));
    }
    case Op::kAdd: {
      const auto [x, y] = numbers("+");
      return push(Value::Number(x + y));
    }
    case Op::kSubtract: {
      const auto [x, y] = numbers("-");
      return push(Value::Number(x - y));
    }
    case Op::kMultiply: {
      const auto [x, y] = numbers("*");
      return push(Value::Number(x * y));
    }
    case Op::kDivide: {
      const auto [x, y] = numbers("/");
      if (y == 0) throw ScriptError("division by zero");
      return push(Value::Number(x / y));
    }
    case Op::kModulo: {
      const auto [x, y] = numbers("%");
      if (y == 0) throw ScriptError("division by zero");
      return push(Value::Number(std::fmod(x, y)));
    }
    default:
      throw ScriptError("unknown instruction");
  }
}

}  // namespace touchstone::rig
