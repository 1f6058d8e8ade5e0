// Words of a script with their places.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace touchstone::rig {

// The script cannot be understood; the program never starts.
struct CompileError : std::runtime_error {
  CompileError(const std::string& what, int at_line, int at_column)
      : std::runtime_error(what), line(at_line), column(at_column) {}
  int line, column;  // from 1
};

struct Token {
  enum class Kind { kName, kNumber, kString, kSign, kLineEnd, kEnd };
  Kind kind;
  std::string text;
  double number = 0;
  int line = 1, column = 1;
};

// Line ends within brackets are left out. Throws CompileError.
std::vector<Token> Lex(const std::string& script);

// How many blocks (def, thread, if, while, sec) a line opens less those that it closes: how a controller
// finds the end of a program in the stream.
int BlocksOpened(const std::string& line);

}  // namespace touchstone::rig
