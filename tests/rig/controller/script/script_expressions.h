// Expressions of a script, by recursive descent that writes instructions as it reads.
#pragma once

#include <string>
#include <vector>

#include "tests/rig/controller/script/script_code_writer.h"

namespace touchstone::rig {

class ExpressionCompiler : protected ScriptCodeWriter {
 protected:
  // `builtins` must outlive it.
  ExpressionCompiler(const std::string& script, const std::vector<BuiltinSignature>& builtins)
      : ScriptCodeWriter(script), builtins_(builtins) {}

  void Expression();
  // Once everything is defined: calls of what was defined below them.
  void ResolveLater();

 private:
  void Binary(int level);
  void Unary();
  int Items(const char* close);
  bool BracketHasComma(int ahead) const;
  void Primary();
  void CheckCount(const Token& name, int least, int most, int given);
  void CheckCall(const Token& name, int index, Op op, int given);
  // A placeholder for a function that is not defined yet.
  int Later(const Token& name, int given);
  void Call(const Token& name);

  const std::vector<BuiltinSignature>& builtins_;
  std::vector<std::pair<Token, int>> later_;
};

}  // namespace touchstone::rig
