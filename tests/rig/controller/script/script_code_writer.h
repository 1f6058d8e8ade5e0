// The compiler's lower half: reads the tokens of a script, writes instructions, and knows names.
#pragma once

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "tests/rig/controller/script/script_program.h"

namespace touchstone::rig {

class ScriptCodeWriter {
 protected:
  using Kind = Token::Kind;
  struct Place {
    int line, column;
  };
  struct Loop {
    int start;
    std::vector<int> breaks;
  };

  explicit ScriptCodeWriter(const std::string& script) : tokens_(Lex(script)) {}

  static const std::set<std::string>& Reserved() {
    static const std::set<std::string> words = {
        "def",          "thread", "sec",  "end",  "if",   "elif",  "else", "while", "break",
        "continue",     "return", "halt", "pass", "run",  "kill",  "join", "local", "global",
        "and",          "or",     "xor",  "not",  "True", "False", "true", "false", "enter_critical",
        "exit_critical"};
    return words;
  }

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
    if (Peek().kind != Kind::kName || Reserved().count(Peek().text)) Fail("expected a name, found " + Seen());
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

  static constexpr int kMaxDepth = 200;  // of blocks and expressions in one another

  std::vector<Token> tokens_;
  size_t at_ = 0;
  int function_ = 0, depth_ = 0;
  ScriptProgram program_;
  std::vector<Loop> loops_;
  std::map<std::string, int> defined_;
  std::vector<std::pair<int, Place>> used_globals_;
  std::set<int> assigned_globals_;
};

}  // namespace touchstone::rig
