// The loosest binding first.
#include "tests/rig/controller/script/script_expressions.h"

namespace touchstone::rig {

void ExpressionCompiler::Expression() {
  if (++depth_ > kMaxDepth) Fail("the expression is nested too deeply");
  Binary(0);
  --depth_;
}

void ExpressionCompiler::Binary(int level) {
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

void ExpressionCompiler::Unary() {
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

int ExpressionCompiler::Items(const char* close) {
  int count = 0;
  while (!IsSign(close)) {
    Expression();
    ++count;
    if (!Take(",")) break;
  }
  Expect(close);
  return count;
}

// A pose p[0,0,0,0,0,0], not an item p[0] of a variable that somebody called p.
bool ExpressionCompiler::BracketHasComma(int ahead) const {
  int depth = 0;
  for (;; ++ahead) {
    const Token& token = Peek(ahead);
    if (token.kind == Kind::kEnd || token.kind == Kind::kLineEnd) return false;
    if (token.kind != Kind::kSign) continue;
    if (token.text == "[" || token.text == "(") ++depth;
    if ((token.text == "]" || token.text == ")") && --depth == 0) return false;
    if (token.text == "," && depth == 1) return true;
  }
}

void ExpressionCompiler::Primary() {
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
  } else if (token.kind == Kind::kName && token.text == "p" && IsSign("[", 1) &&
             (LocalOf("p") < 0 || BracketHasComma(1))) {
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
    if (index >= 0) CheckCall(name, index, Op::kRun, count);
    EmitAt(name, Op::kRun, index >= 0 ? index : Later(name, count), count);
  } else if (token.kind == Kind::kName && !Reserved().count(token.text)) {
    Next();
    if (IsSign("("))
      Call(token);
    else
      Load(token);
  } else {
    Fail("unexpected " + Seen());
  }
}

void ExpressionCompiler::CheckCount(const Token& name, int least, int most, int given) {
  if (given < least || given > most)
    throw CompileError("compile_error_arguments:" + name.text + ": takes " + std::to_string(least) +
                           (most > least ? " to " + std::to_string(most) : "") + ", has " +
                           std::to_string(given),
                       name.line, name.column);
}

void ExpressionCompiler::CheckCall(const Token& name, int index, Op op, int given) {
  const ScriptFunction& function = program_.functions[index];
  if (op == Op::kRun && !function.thread)
    throw CompileError("compile_error_name_not_found:" + name.text + ":", name.line, name.column);
  CheckCount(name, function.parameters, function.parameters, given);
}

int ExpressionCompiler::Later(const Token& name, int given) {
  later_.push_back({name, given});
  return -static_cast<int>(later_.size());
}

void ExpressionCompiler::ResolveLater() {
  for (ScriptFunction& function : program_.functions) {
    for (Instruction& code : function.code) {
      if ((code.op != Op::kCall && code.op != Op::kRun) || code.a >= 0) continue;
      const auto& [name, given] = later_[-code.a - 1];
      const int index = FunctionOf(name.text);
      if (index < 0)
        throw CompileError("compile_error_name_not_found:" + name.text + ":", name.line, name.column);
      CheckCall(name, index, code.op, given);
      code.a = index;
    }
  }
}

void ExpressionCompiler::Call(const Token& name) {
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
  if (builtin < 0) {  // may be defined below
    const int count = Items(")");
    EmitAt(name, Op::kCall, Later(name, count), count);
    return;
  }
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

}  // namespace touchstone::rig
