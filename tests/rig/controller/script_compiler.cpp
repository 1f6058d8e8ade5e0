#include <functional>
#include <set>

#include "tests/rig/controller/script_program.h"

namespace touchstone::rig {
namespace {

using Kind = Token::Kind;

const std::set<std::string> kReserved = {"def",   "thread", "sec",      "end",    "if",   "elif", "else",
                                         "while", "break",  "continue", "return", "halt", "pass", "run",
                                         "kill",  "join",   "local",    "global", "and",  "or",   "xor",
                                         "not",   "True",   "False",    "true",   "false"};

// Recursive descent that writes instructions as it reads.
class Compiler {
 public:
  Compiler(const std::string& script, const std::vector<BuiltinSignature>& builtins)
      : tokens_(Lex(script)), builtins_(builtins) {}

  ScriptProgram Program() {
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
    program_.functions[0].name = program_.name;
    for (const auto& [index, place] : used_globals_)
      if (!assigned_globals_.count(index))
        throw CompileError("compile_error_name_not_found:" + program_.globals[index] + ":", place.line,
                           place.column);
    return std::move(program_);
  }

 private:
  struct Place {
    int line, column;
  };
  struct Loop {
    int start;
    std::vector<int> breaks;
  };

  // Words.
  const Token& Peek(int ahead = 0) const { return tokens_[std::min(at_ + ahead, tokens_.size() - 1)]; }
  const Token& Next() {
    const Token& token = Peek();
    if (at_ + 1 < tokens_.size()) ++at_;
    return token;
  }
  bool IsWord(const std::string& word) const { return Peek().kind == Kind::kName && Peek().text == word; }
  bool IsSign(const std::string& sign, int ahead = 0) const {
    return Peek(ahead).kind == Kind::kSign && Peek(ahead).text == sign;
  }
  [[noreturn]] void Fail(const std::string& why) const {
    throw CompileError("syntax_error_on_line:" + std::to_string(Peek().line) + ":" + why, Peek().line,
                       Peek().column);
  }
  std::string Seen() const {
    if (Peek().kind == Kind::kEnd) return "the end of the program";
    return Peek().kind == Kind::kLineEnd ? "the end of the line" : "'" + Peek().text + "'";
  }
  void Expect(const std::string& sign) {
    if (!IsSign(sign)) Fail("expected '" + sign + "', found " + Seen());
    Next();
  }
  void ExpectWord(const std::string& word) {
    if (!IsWord(word)) Fail("expected '" + word + "', found " + Seen());
    Next();
  }
  bool Take(const std::string& sign) {
    if (!IsSign(sign)) return false;
    Next();
    return true;
  }
  void SkipLineEnds() {
    while (Peek().kind == Kind::kLineEnd) Next();
  }
  std::string NewName() {
    if (Peek().kind != Kind::kName || kReserved.count(Peek().text)) Fail("expected a name, found " + Seen());
    return Next().text;
  }

  // Instructions.
  ScriptFunction& F() { return program_.functions[function_]; }
  int Here() { return static_cast<int>(F().code.size()); }
  int Emit(Op op, int a = 0, int b = 0) {
    F().code.push_back({op, a, b, Peek().line, Peek().column});
    return Here() - 1;
  }
  int EmitAt(const Token& token, Op op, int a = 0, int b = 0) {
    F().code.push_back({op, a, b, token.line, token.column});
    return Here() - 1;
  }
  void Constant(Value value) {
    program_.constants.push_back(std::move(value));
    Emit(Op::kConstant, static_cast<int>(program_.constants.size()) - 1);
  }
  void Finish() {
    Constant(Value());
    Emit(Op::kReturn);
  }

  // Names.
  int LocalOf(const std::string& name) {
    if (function_ == 0) return -1;
    for (size_t i = 0; i < F().locals.size(); ++i)
      if (F().locals[i] == name) return static_cast<int>(i);
    return -1;
  }
  int GlobalOf(const std::string& name, bool make) {
    for (size_t i = 0; i < program_.globals.size(); ++i)
      if (program_.globals[i] == name) return static_cast<int>(i);
    if (!make) return -1;
    program_.globals.push_back(name);
    return static_cast<int>(program_.globals.size()) - 1;
  }
  enum class Scope { kNearest, kLocal, kGlobal };
  // Where an assignment to the name goes: (true, slot) if local.
  std::pair<bool, int> TargetOf(const std::string& name, Scope scope) {
    if (function_ != 0 && scope != Scope::kGlobal) {
      if (const int local = LocalOf(name); local >= 0) return {true, local};
      const int global = GlobalOf(name, false);
      if (scope == Scope::kLocal || global < 0 || !assigned_globals_.count(global)) {
        F().locals.push_back(name);
        return {true, static_cast<int>(F().locals.size()) - 1};
      }
    }
    const int global = GlobalOf(name, true);
    assigned_globals_.insert(global);
    return {false, global};
  }
  void Load(const Token& name) {
    if (const int local = LocalOf(name.text); local >= 0) {
      EmitAt(name, Op::kLoadLocal, local);
      return;
    }
    const int global = GlobalOf(name.text, true);
    used_globals_.push_back({global, {name.line, name.column}});
    EmitAt(name, Op::kLoadGlobal, global);
  }
  int FunctionOf(const std::string& name) {
    const auto found = defined_.find(name);
    return found == defined_.end() ? -1 : found->second;
  }

  // Statements.
  void Block(const std::vector<std::string>& ends) {
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

  void Statement() {
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
    if (IsWord("pass")) {
      Next();
      return;
    }
    if (IsWord("kill") || IsWord("join")) {
      const Token word = Next();
      Expression();
      EmitAt(word, word.text == "kill" ? Op::kKill : Op::kJoin);
      return;
    }
    if (Peek().kind == Kind::kName && !kReserved.count(Peek().text)) {
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

  void Store(const Token& name, Scope scope, bool item) {
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

  void Definition() {
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

  void If() {
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

  void While() {
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

  // Expressions, the loosest binding first.
  void Expression() {
    if (++depth_ > kMaxDepth) Fail("the expression is nested too deeply");
    Binary(0);
    --depth_;
  }

  void Binary(int level) {
    static const std::vector<std::vector<std::pair<const char*, Op>>> kLevels = {
        {{"or", Op::kOr}, {"xor", Op::kXor}},
        {{"and", Op::kAnd}},
        {},  // not
        {{"==", Op::kEqual},
         {"!=", Op::kUnequal},
         {"<=", Op::kLessEqual},
         {">=", Op::kGreaterEqual},
         {"<", Op::kLess},
         {">", Op::kGreater}},
        {{"+", Op::kAdd}, {"-", Op::kSubtract}},
        {{"*", Op::kMultiply}, {"/", Op::kDivide}, {"%", Op::kModulo}},
    };
    if (level == static_cast<int>(kLevels.size())) return Unary();
    if (level == 2) {
      if (!IsWord("not")) return Binary(3);
      const Token word = Next();
      if (++depth_ > kMaxDepth) Fail("the expression is nested too deeply");
      Binary(2);
      --depth_;
      EmitAt(word, Op::kNot);
      return;
    }
    Binary(level + 1);
    for (;;) {
      const Token sign = Peek();
      const std::pair<const char*, Op>* match = nullptr;
      for (const auto& each : kLevels[level])
        if ((sign.kind == Kind::kSign || sign.kind == Kind::kName) && sign.text == each.first) match = &each;
      if (!match) return;
      Next();
      Binary(level + 1);
      EmitAt(sign, match->second);
    }
  }

  void Unary() {
    if (IsSign("-") || IsSign("+")) {
      const Token sign = Next();
      if (++depth_ > kMaxDepth) Fail("the expression is nested too deeply");
      Unary();
      --depth_;
      if (sign.text == "-") EmitAt(sign, Op::kNegate);
      return;
    }
    Primary();
    while (IsSign("[")) {
      const Token sign = Next();
      Expression();
      Expect("]");
      EmitAt(sign, Op::kIndex);
    }
  }

  int Items(const char* close) {
    int count = 0;
    while (!IsSign(close)) {
      Expression();
      ++count;
      if (!Take(",")) break;
    }
    Expect(close);
    return count;
  }

  void Primary() {
    const Token token = Peek();
    if (token.kind == Kind::kNumber) {
      Next();
      Constant(Value::Number(token.number));
    } else if (token.kind == Kind::kString) {
      Next();
      Constant(Value::String(token.text));
    } else if (Take("(")) {
      Expression();
      if (IsSign(",")) {  // (1, 2, 3): some clients write lists so
        int count = 1;
        while (Take(",")) {
          Expression();
          ++count;
        }
        EmitAt(token, Op::kMakeList, count);
      }
      Expect(")");
    } else if (Take("[")) {
      EmitAt(token, Op::kMakeList, Items("]"));
    } else if (token.kind == Kind::kName && token.text == "p" && IsSign("[", 1)) {
      Next();
      Next();
      if (Items("]") != 6) Fail("a pose has six numbers");
      EmitAt(token, Op::kMakePose);
    } else if (IsWord("True") || IsWord("False") || IsWord("true") || IsWord("false")) {
      Next();
      Constant(Value::Bool(token.text == "True" || token.text == "true"));
    } else if (IsWord("run")) {
      Next();
      const Token name = Peek();
      NewName();
      Expect("(");
      const int count = Items(")");
      const int index = FunctionOf(name.text);
      if (index < 0 || !program_.functions[index].thread)
        throw CompileError("compile_error_name_not_found:" + name.text + ":", name.line, name.column);
      CheckCount(name, program_.functions[index].parameters, program_.functions[index].parameters, count);
      EmitAt(name, Op::kRun, index, count);
    } else if (token.kind == Kind::kName && !kReserved.count(token.text)) {
      Next();
      if (IsSign("("))
        Call(token);
      else
        Load(token);
    } else {
      Fail("unexpected " + Seen());
    }
  }

  void CheckCount(const Token& name, int least, int most, int given) {
    if (given < least || given > most)
      throw CompileError("compile_error_arguments:" + name.text + ": takes " + std::to_string(least) +
                             (most > least ? " to " + std::to_string(most) : "") + ", has " +
                             std::to_string(given),
                         name.line, name.column);
  }

  void Call(const Token& name) {
    Expect("(");
    if (const int index = FunctionOf(name.text); index >= 0) {
      const int count = Items(")");
      CheckCount(name, program_.functions[index].parameters, program_.functions[index].parameters, count);
      EmitAt(name, Op::kCall, index, count);
      return;
    }
    int builtin = -1;
    for (size_t i = 0; i < builtins_.size(); ++i)
      if (name.text == builtins_[i].name) builtin = static_cast<int>(i);
    if (builtin < 0)
      throw CompileError("compile_error_name_not_found:" + name.text + ":", name.line, name.column);
    // Arguments by place and by name become one list in the order of the parameters; the missing are None.
    const BuiltinSignature& signature = builtins_[builtin];
    const int most = static_cast<int>(signature.parameters.size());
    std::vector<std::vector<Instruction>> given(most);
    int place = 0;
    while (!IsSign(")")) {
      int parameter = place;
      if (Peek().kind == Kind::kName && IsSign("=", 1)) {
        parameter = -1;
        for (int i = 0; i < most; ++i)
          if (Peek().text == signature.parameters[i]) parameter = i;
        if (parameter < 0) Fail(name.text + " has no parameter '" + Peek().text + "'");
        Next();
        Next();
      } else {
        ++place;
      }
      if (parameter >= most) CheckCount(name, signature.required, most, parameter + 1);
      if (!given[parameter].empty()) Fail("an argument of " + name.text + " is given twice");
      const size_t begin = F().code.size();
      Expression();
      given[parameter].assign(F().code.begin() + begin, F().code.end());
      F().code.resize(begin);
      if (!Take(",")) break;
    }
    Expect(")");
    for (int i = 0; i < most; ++i) {
      if (given[i].empty()) {
        if (i < signature.required) CheckCount(name, signature.required, most, i);
        Constant(Value());
      } else {
        F().code.insert(F().code.end(), given[i].begin(), given[i].end());
      }
    }
    EmitAt(name, Op::kBuiltin, builtin, most);
  }

  static constexpr int kMaxDepth = 200;

  std::vector<Token> tokens_;
  const std::vector<BuiltinSignature>& builtins_;
  size_t at_ = 0;
  int function_ = 0, depth_ = 0;
  ScriptProgram program_;
  std::vector<Loop> loops_;
  std::map<std::string, int> defined_;
  std::vector<std::pair<int, Place>> used_globals_;
  std::set<int> assigned_globals_;
};

}  // namespace

ScriptProgram Compile(const std::string& script, const std::vector<BuiltinSignature>& builtins) {
  return Compiler(script, builtins).Program();
}

}  // namespace touchstone::rig
