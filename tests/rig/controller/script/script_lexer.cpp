#include "tests/rig/controller/script/script_lexer.h"

#include <cctype>
#include <cstdlib>

namespace touchstone::rig {

std::vector<Token> Lex(const std::string& script) {
  std::vector<Token> tokens;
  int line = 1, brackets = 0;
  size_t i = 0, line_begin = 0;
  const auto add = [&](Token::Kind kind, size_t from, size_t to) {
    tokens.push_back(
        {kind, script.substr(from, to - from), 0, line, static_cast<int>(from - line_begin) + 1});
  };
  while (i < script.size()) {
    const unsigned char c = script[i];
    const size_t from = i;
    if (c == '\n') {
      if (brackets == 0) add(Token::Kind::kLineEnd, i, i + 1);
      ++i;
      ++line;
      line_begin = i;
    } else if (std::isspace(c)) {
      ++i;
    } else if (c == '#' || c == '$') {  // a comment, or a label of the program tree
      while (i < script.size() && script[i] != '\n') ++i;
    } else if (std::isalpha(c) || c == '_') {
      while (i < script.size() && (std::isalnum(static_cast<unsigned char>(script[i])) || script[i] == '_'))
        ++i;
      add(Token::Kind::kName, from, i);
    } else if (std::isdigit(c) || (c == '.' && i + 1 < script.size() &&
                                   std::isdigit(static_cast<unsigned char>(script[i + 1])))) {
      const char* begin = script.c_str() + i;
      char* end = nullptr;
      const double number = std::strtod(begin, &end);
      i += end - begin;
      add(Token::Kind::kNumber, from, i);
      tokens.back().number = number;
    } else if (c == '"' || c == '\'') {
      const size_t close = script.find(script[i], i + 1);
      const size_t line_end = script.find('\n', i);
      if (close == std::string::npos || close > line_end)
        throw CompileError("syntax_error: a string does not end on its line", line,
                           static_cast<int>(i - line_begin) + 1);
      add(Token::Kind::kString, from + 1, close);
      i = close + 1;
    } else {
      const std::string two = script.substr(i, 2);
      const bool pair = two == "==" || two == "!=" || two == "<=" || two == ">=";
      if (!pair && std::string("+-*/%()[]{},:=<>;.").find(static_cast<char>(c)) == std::string::npos)
        throw CompileError("syntax_error: unexpected character " + std::to_string(c), line,
                           static_cast<int>(i - line_begin) + 1);
      i += pair ? 2 : 1;
      add(Token::Kind::kSign, from, i);
      if (!pair && (c == '(' || c == '[')) ++brackets;
      if (!pair && (c == ')' || c == ']') && brackets > 0) --brackets;
      if (c == ';') tokens.back().kind = Token::Kind::kLineEnd;
    }
  }
  tokens.push_back({Token::Kind::kEnd, "", 0, line, static_cast<int>(i - line_begin) + 1});
  return tokens;
}

int BlocksOpened(const std::string& line) {
  int opened = 0;
  for (size_t i = 0; i < line.size();) {
    const unsigned char c = line[i];
    if (c == '#' || c == '$') break;
    if (c == '"' || c == '\'') {
      const size_t close = line.find(line[i], i + 1);
      if (close == std::string::npos) break;
      i = close + 1;
    } else if (std::isalpha(c) || c == '_') {
      const size_t from = i;
      while (i < line.size() && (std::isalnum(static_cast<unsigned char>(line[i])) || line[i] == '_')) ++i;
      const std::string word = line.substr(from, i - from);
      if (word == "def" || word == "thread" || word == "if" || word == "while" || word == "sec") ++opened;
      if (word == "end") --opened;
    } else if (std::isdigit(c)) {  // 0x1F or 1e5: no words
      while (i < line.size() && (std::isalnum(static_cast<unsigned char>(line[i])) || line[i] == '.')) ++i;
    } else {
      ++i;
    }
  }
  return opened;
}

}  // namespace touchstone::rig
