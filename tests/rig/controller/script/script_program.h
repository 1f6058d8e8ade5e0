// A compiled script: instructions for the machine of script_machine.h.
//
// The subset of URScript: def, thread and sec programs; nested def and thread; run, kill, join; local,
// global; if/elif/else, while, break, continue, return, halt, pass; and, or, xor, not; == != < <= > >= + - *
// / %; numbers, True, False, strings, lists [..], poses p[..], indexing (reading and writing); calls with
// named arguments; the functions of script_functions.cpp. Not: switch, structs, interpreter mode, sockets,
// XML-RPC, string escapes. Functions that are not emulated compile (script_functions_other.cpp). A name that is first assigned in the outermost def is visible in everything that
// is defined in it; one that is first assigned in a nested def or thread is its own, unless declared global.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "tests/rig/controller/script/script_lexer.h"
#include "tests/rig/controller/script/script_value.h"

namespace touchstone::rig {

enum class Op {
  kConstant,   // push constants[a]
  kLoadLocal,  // push local a
  kStoreLocal,
  kLoadGlobal,
  kStoreGlobal,
  kStoreItemLocal,  // value, index on the stack
  kStoreItemGlobal,
  kJump,  // to a
  kJumpIfFalse,
  kCall,     // function a with b arguments
  kBuiltin,  // function a of the controller with arguments in the order of its parameters, b of them given
  kRun,      // function a with b arguments, as a thread
  kKill,
  kJoin,
  kReturn,  // the value on the stack
  kPop,
  kMakeList,  // of a items
  kMakePose,
  kIndex,
  kHalt,
  kNegate,
  kNot,
  kAnd,
  kOr,
  kXor,
  kEqual,
  kUnequal,
  kLess,
  kLessEqual,
  kGreater,
  kGreaterEqual,
  kAdd,
  kSubtract,
  kMultiply,
  kDivide,
  kModulo,
};

struct Instruction {
  Op op;
  int a = 0, b = 0;
  int line = 0, column = 0;
};

struct ScriptFunction {
  std::string name;
  int parameters = 0;
  bool thread = false;
  std::vector<Instruction> code;
  std::vector<std::string> locals;  // parameters first
};

struct ScriptProgram {
  std::string name;
  bool secondary = false;                 // `sec`
  std::vector<ScriptFunction> functions;  // 0: the program itself
  std::vector<Value> constants;
  std::vector<std::string> globals;
};

// What the compiler knows of a function of the controller.
struct BuiltinSignature {
  const char* name;
  std::vector<const char*> parameters;
  int required;
};

// Throws CompileError. `builtins`: called by their index.
ScriptProgram Compile(const std::string& script, const std::vector<BuiltinSignature>& builtins);

}  // namespace touchstone::rig
