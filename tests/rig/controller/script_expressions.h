// Expressions of a script, by recursive descent that writes instructions as it reads.
#pragma once

#include <string>
#include <vector>

#include "tests/rig/controller/script_code_writer.h"

namespace touchstone::rig {

class ExpressionCompiler : protected ScriptCodeWriter {
 protected:
  // `builtins` must outlive it.
  ExpressionCompiler(const std::string& script, const std::vector<BuiltinSignature>& builtins)
      : ScriptCodeWriter(script), builtins_(builtins) {}

  void Expression();

 private:
  void Binary(int level);
  void Unary();
  int Items(const char* close);
  void Primary();
  void CheckCount(const Token& name, int least, int most, int given);
  void Call(const Token& name);

  const std::vector<BuiltinSignature>& builtins_;
};

}  // namespace touchstone::rig
