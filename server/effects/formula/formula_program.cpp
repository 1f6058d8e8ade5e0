#include "server/effects/formula/formula_program.h"

#include <absl/strings/ascii.h>
#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <muParser.h>

#include <algorithm>
#include <cmath>

#include "server/base/check.h"
#include "server/base/status.h"
#include "server/base/units.h"
#include "server/effects/formula/formula.h"

namespace touchstone::effects {
namespace {

double Sin(double x) {
  return std::sin(x);
}
double Cos(double x) {
  return std::cos(x);
}
double Tan(double x) {
  return std::tan(x);
}
double Asin(double x) {
  return std::asin(x);
}
double Acos(double x) {
  return std::acos(x);
}
double Atan(double x) {
  return std::atan(x);
}
double Atan2(double y, double x) {
  return std::atan2(y, x);
}
double Sinh(double x) {
  return std::sinh(x);
}
double Cosh(double x) {
  return std::cosh(x);
}
double Tanh(double x) {
  return std::tanh(x);
}
double Exp(double x) {
  return std::exp(x);
}
double Log(double x) {
  return std::log(x);
}
double Log10(double x) {
  return std::log10(x);
}
double Sqrt(double x) {
  return std::sqrt(x);
}
double Abs(double x) {
  return std::fabs(x);
}
double Sign(double x) {
  return (x > 0) - (x < 0);
}
double Floor(double x) {
  return std::floor(x);
}
double Ceil(double x) {
  return std::ceil(x);
}
double Round(double x) {
  return std::round(x);
}
double Hypot(double x, double y) {
  return std::sqrt(x * x + y * y);
}
double Min(const double* values, int count) {
  return *std::min_element(values, values + count);
}
double Max(const double* values, int count) {
  return *std::max_element(values, values + count);
}

// A parser that knows exactly the documented functions and constants, and no variable yet.
void Prepare(mu::Parser* parser) {
  parser->ClearFun();
  parser->ClearConst();
  parser->DefineFun("sin", Sin);
  parser->DefineFun("cos", Cos);
  parser->DefineFun("tan", Tan);
  parser->DefineFun("asin", Asin);
  parser->DefineFun("acos", Acos);
  parser->DefineFun("atan", Atan);
  parser->DefineFun("atan2", Atan2);
  parser->DefineFun("sinh", Sinh);
  parser->DefineFun("cosh", Cosh);
  parser->DefineFun("tanh", Tanh);
  parser->DefineFun("exp", Exp);
  parser->DefineFun("log", Log);
  parser->DefineFun("log10", Log10);
  parser->DefineFun("sqrt", Sqrt);
  parser->DefineFun("abs", Abs);
  parser->DefineFun("sign", Sign);
  parser->DefineFun("floor", Floor);
  parser->DefineFun("ceil", Ceil);
  parser->DefineFun("round", Round);
  parser->DefineFun("hypot", Hypot);
  parser->DefineFun("min", Min);
  parser->DefineFun("max", Max);
  parser->DefineConst("pi", kPi);
  parser->DefineConst("e", 2.71828182845904523536);
}

bool IsNameCharacter(char c) {
  return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_';
}

absl::Status Wrong(size_t index, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat("character ", index + 1, ": ", what));
}

// What muParser would take and a formula must not have: assignments, texts, control characters.
absl::Status CheckCharacters(const std::string& expression) {
  if (expression.find_first_not_of(" \t\n") == std::string::npos)
    return absl::InvalidArgumentError("it is empty; write for example \"k * finger\"");
  if (expression.size() > kMaxFormulaCharacters)
    return absl::InvalidArgumentError(absl::StrCat("it has ", expression.size(), " characters; at most ",
                                                   kMaxFormulaCharacters, " are taken"));
  for (size_t i = 0; i < expression.size(); ++i) {
    const char c = expression[i];
    if (!IsNameCharacter(c) &&
        (c == '\0' || std::string(" \t\n.+-*/^(),?:<>=!&|").find(c) == std::string::npos))
      return Wrong(i, absl::StrCat("'", absl::CEscape(std::string(1, c)), "' has no place in a formula"));
    const char before = i > 0 ? expression[i - 1] : ' ';
    const char after = i + 1 < expression.size() ? expression[i + 1] : ' ';
    if (c == '=' && after != '=' && std::string("=!<>").find(before) == std::string::npos)
      return Wrong(i, "a formula cannot assign; to compare write '=='");
  }
  // muParser does not say where a parenthesis is missing.
  std::vector<size_t> open;
  for (size_t i = 0; i < expression.size(); ++i) {
    if (expression[i] == '(') open.push_back(i);
    if (expression[i] != ')') continue;
    if (open.empty()) return Wrong(i, "this ')' closes nothing");
    open.pop_back();
  }
  if (!open.empty()) return Wrong(open.back(), "this '(' is never closed");
  return absl::OkStatus();
}

// muParser's words without its own place, which counts from 0.
std::string Words(const mu::ParserError& error) {
  std::string message = error.GetMsg();
  for (const char* phrase : {" found at position ", " at position "}) {
    const size_t begin = message.find(phrase);
    if (begin == std::string::npos) continue;
    const size_t end = message.find_first_not_of("0123456789", begin + std::string(phrase).size());
    message.erase(begin, end == std::string::npos ? end : end - begin);
  }
  return message;
}

// The names outside of functions and constants, in order. Numbers such as 1e-3 are not names.
std::vector<UsedName> NamesIn(const std::string& expression, const mu::varmap_type& used) {
  std::vector<UsedName> names;
  for (size_t i = 0; i < expression.size();) {
    if (!IsNameCharacter(expression[i])) {
      ++i;
      continue;
    }
    size_t end = i;
    while (end < expression.size() && IsNameCharacter(expression[end])) ++end;
    const std::string word = expression.substr(i, end - i);
    const bool seen =
        std::any_of(names.begin(), names.end(), [&](const UsedName& n) { return n.name == word; });
    if (used.count(word) != 0 && !seen) names.push_back({word, static_cast<int>(i) + 1});
    i = end;
  }
  return names;
}

class MuParserEvaluator : public FormulaProgram::Evaluator {
 public:
  MuParserEvaluator(const std::string& expression, const std::vector<UsedName>& names)
      : inputs_(names.size()) {
    Prepare(&parser_);
    for (size_t i = 0; i < names.size(); ++i) parser_.DefineVar(names[i].name, &inputs_[i]);
    parser_.SetExpr(expression);
  }
  double* inputs() override { return inputs_.data(); }
  double Value() override { return parser_.Eval(); }
  int ResultCount() {
    parser_.Eval();
    return parser_.GetNumResults();
  }

 private:
  std::vector<double> inputs_;  // never resized: the parser points into it
  mu::Parser parser_;
};

}  // namespace

FormulaProgram::~FormulaProgram() = default;

absl::StatusOr<std::shared_ptr<const FormulaProgram>> FormulaProgram::Compile(const std::string& expression) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckCharacters(expression));
  std::shared_ptr<FormulaProgram> program(new FormulaProgram);
  // muParser takes one line.
  program->expression_ = expression;
  std::replace_if(program->expression_.begin(), program->expression_.end(), absl::ascii_isspace, ' ');
  try {
    mu::Parser parser;
    Prepare(&parser);
    parser.SetExpr(program->expression_);
    program->names_ = NamesIn(program->expression_, parser.GetUsedVar());
    auto evaluator = std::make_unique<MuParserEvaluator>(program->expression_, program->names_);
    const int results = evaluator->ResultCount();
    if (results != 1)
      return absl::InvalidArgumentError(
          absl::StrCat("it has ", results, " results, separated by commas; write one"));
    program->idle_.push_back(std::move(evaluator));
  } catch (const mu::ParserError& error) {
    // The end of the expression is reported one place behind it, an unknown place as -1.
    if (error.GetPos() < 0) return absl::InvalidArgumentError(Words(error));
    return Wrong(std::min<size_t>(error.GetPos(), expression.size()), Words(error));
  }
  return std::shared_ptr<const FormulaProgram>(std::move(program));
}

FormulaProgram::Loan::Loan(const FormulaProgram& program) : program_(program) {
  {
    const std::lock_guard<std::mutex> lock(program_.mutex_);
    if (!program_.idle_.empty()) {
      evaluator_ = std::move(program_.idle_.back());
      program_.idle_.pop_back();
    }
  }
  if (evaluator_ == nullptr)
    evaluator_ = std::make_unique<MuParserEvaluator>(program_.expression_, program_.names_);
}

FormulaProgram::Loan::~Loan() {
  const std::lock_guard<std::mutex> lock(program_.mutex_);
  program_.idle_.push_back(std::move(evaluator_));
}

}  // namespace touchstone::effects
