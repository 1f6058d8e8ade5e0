// Statements of a script, and the program that they make.
#include "tests/rig/controller/script/script_expressions.h"

namespace touchstone::rig {
namespace {

class StatementCompiler : private ExpressionCompiler {
 public:
  StatementCompiler(const std::string& script, const std::vector<BuiltinSignature>& builtins)
      : ExpressionCompiler(script, builtins) {}

  ScriptProgram Program();

 private:
  void Block(const std::vector<std::string>& ends);
  void Statement();
  void Store(const Token& name, Scope scope, bool item);
  void Definition();
  void If();
  void While();
};

ScriptProgram StatementCompiler::Program() {
  SkipLineEnds();
  if (Peek().kind == Kind::kEnd) Fail("the program is empty");
  program_.functions.emplace_back();
  if (IsWord("def") || IsWord("sec")) {
    program_.secondary = Next().text == "sec";
    program_.name = NewName();
    if (program_.name.size() > 31)
      Fail("the program's name '" + program_.name + "' has more than 31 characters");
    Expect("(");
    Expect(")");
    Expect(":");
    function_ = 0;
    Block({"end"});
    ExpectWord("end");
  } else {  // single lines are a program too
    program_.name = "unnamed";
    function_ = 0;
    while (Peek().kind != Kind::kEnd) {
      Statement();
      SkipLineEnds();
    }
  }
  SkipLineEnds();
  if (Peek().kind != Kind::kEnd) Fail("unexpected '" + Peek().text + "' behind the program's end");
  Finish();
  ResolveLater();
  program_.functions[0].name = program_.name;
  for (const auto& [index, place] : used_globals_)
    if (!assigned_globals_.count(index))
      throw CompileError("compile_error_name_not_found:" + program_.globals[index] + ":", place.line,
                         place.column);
  return std::move(program_);
}

void StatementCompiler::Block(const std::vector<std::string>& ends) {
  if (++depth_ > kMaxDepth) Fail("blocks are nested too deeply");
  for (;;) {
    SkipLineEnds();
    if (Peek().kind == Kind::kEnd) Fail("a block has no 'end'");
    for (const std::string& end : ends) {
      if (IsWord(end)) {
        --depth_;
        return;
      }
    }
    Statement();
  }
}

void StatementCompiler::Statement() {
  if (IsWord("def") || IsWord("thread")) return Definition();
  if (IsWord("if")) return If();
  if (IsWord("while")) return While();
  if (IsWord("local") || IsWord("global")) {
    const Scope scope = Next().text == "local" ? Scope::kLocal : Scope::kGlobal;
    const Token name = Peek();
    NewName();
    if (!IsSign("=")) {  // a declaration alone
      TargetOf(name.text, scope);
      return;
    }
    Next();
    SkipLineEnds();  // ur_rtde writes "global x = # comment" and the value on the next line
    Expression();
    return Store(name, scope, false);
  }
  if (IsWord("return")) {
    Next();
    if (Peek().kind == Kind::kLineEnd || IsWord("end") || Peek().kind == Kind::kEnd)
      Constant(Value());
    else
      Expression();
    Emit(Op::kReturn);
    return;
  }
  if (IsWord("break") || IsWord("continue")) {
    const bool is_break = Next().text == "break";
    if (loops_.empty()) Fail("break or continue outside of a loop");
    const int jump = Emit(Op::kJump, loops_.back().start);
    if (is_break) loops_.back().breaks.push_back(jump);
    return;
  }
  if (IsWord("halt")) {
    Next();
    Emit(Op::kHalt);
    return;
  }
  // Threads here only give way where they wait: every section is critical.
  if (IsWord("pass") || IsWord("enter_critical") || IsWord("exit_critical")) {
    Next();
    return;
  }
  if (IsWord("kill") || IsWord("join")) {
    const Token word = Next();
    Expression();
    EmitAt(word, word.text == "kill" ? Op::kKill : Op::kJoin);
    return;
  }
  if (Peek().kind == Kind::kName && !Reserved().count(Peek().text)) {
    if (IsSign("=", 1)) {
      const Token name = Next();
      Next();
      Expression();
      return Store(name, Scope::kNearest, false);
    }
    if (IsSign("[", 1)) {  // name[i] = value, or an expression that begins so
      const size_t back = at_;
      const size_t code = F().code.size(), constants = program_.constants.size();
      const Token name = Next();
      Next();
      Expression();
      Expect("]");
      if (IsSign("=")) {
        Next();
        Expression();
        return Store(name, Scope::kNearest, true);
      }
      at_ = back;
      F().code.resize(code);
      program_.constants.resize(constants);
    }
  }
  Expression();
  Emit(Op::kPop);
}

void StatementCompiler::Store(const Token& name, Scope scope, bool item) {
  if (item) {
    if (const int local = LocalOf(name.text); local >= 0) {
      EmitAt(name, Op::kStoreItemLocal, local);
    } else {
      const int global = GlobalOf(name.text, true);
      used_globals_.push_back({global, {name.line, name.column}});
      EmitAt(name, Op::kStoreItemGlobal, global);
    }
    return;
  }
  const auto [is_local, slot] = TargetOf(name.text, scope);
  EmitAt(name, is_local ? Op::kStoreLocal : Op::kStoreGlobal, slot);
}

void StatementCompiler::Definition() {
  const bool thread = Next().text == "thread";
  const Token place = Peek();
  const std::string name = NewName();
  if (defined_.count(name)) Fail("'" + name + "' is defined twice");
  const int index = static_cast<int>(program_.functions.size());
  program_.functions.emplace_back();
  defined_[name] = index;
  const int outer = function_;
  std::vector<Loop> outer_loops;
  outer_loops.swap(loops_);
  function_ = index;
  F().name = name;
  F().thread = thread;
  Expect("(");
  while (!IsSign(")")) {
    F().locals.push_back(NewName());
    if (!Take(",")) break;
  }
  Expect(")");
  F().parameters = static_cast<int>(F().locals.size());
  Expect(":");
  Block({"end"});
  ExpectWord("end");
  Finish();
  function_ = outer;
  loops_.swap(outer_loops);
}

void StatementCompiler::If() {
  std::vector<int> done;
  Next();
  Expression();
  Expect(":");
  int skip = Emit(Op::kJumpIfFalse);
  Block({"elif", "else", "end"});
  while (IsWord("elif")) {
    done.push_back(Emit(Op::kJump));
    F().code[skip].a = Here();
    Next();
    Expression();
    Expect(":");
    skip = Emit(Op::kJumpIfFalse);
    Block({"elif", "else", "end"});
  }
  if (IsWord("else")) {
    done.push_back(Emit(Op::kJump));
    F().code[skip].a = Here();
    skip = -1;
    Next();
    Expect(":");
    Block({"end"});
  }
  ExpectWord("end");
  if (skip >= 0) F().code[skip].a = Here();
  for (const int jump : done) F().code[jump].a = Here();
}

void StatementCompiler::While() {
  Next();
  const int start = Here();
  Expression();
  Expect(":");
  const int leave = Emit(Op::kJumpIfFalse);
  loops_.push_back({start, {}});
  Block({"end"});
  ExpectWord("end");
  Emit(Op::kJump, start);
  F().code[leave].a = Here();
  for (const int jump : loops_.back().breaks) F().code[jump].a = Here();
  loops_.pop_back();
}

}  // namespace

ScriptProgram Compile(const std::string& script, const std::vector<BuiltinSignature>& builtins) {
  return StatementCompiler(script, builtins).Program();
}

}  // namespace touchstone::rig
