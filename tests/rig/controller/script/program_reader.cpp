#include "tests/rig/controller/script/program_reader.h"

#include "tests/rig/controller/script/script_lexer.h"

namespace touchstone::rig {
namespace {

constexpr size_t kMaxBytes = 4 << 20;

bool Blank(const std::string& line) {
  const size_t first = line.find_first_not_of(" \t\r");
  return first == std::string::npos || line[first] == '#';
}

}  // namespace

std::vector<std::string> ProgramReader::Feed(const std::string& bytes) {
  std::vector<std::string> programs;
  for (const char c : bytes) {
    if (c != '\n') {
      line_.push_back(c);
      if (line_.size() + program_.size() > kMaxBytes) {  // no program: starts anew
        line_.clear();
        program_.clear();
        depth_ = 0;
      }
      continue;
    }
    if (depth_ == 0 && Blank(line_)) {
      line_.clear();
      continue;
    }
    depth_ += BlocksOpened(line_);
    program_ += line_ + "\n";
    line_.clear();
    if (depth_ > 0) continue;
    depth_ = 0;
    programs.push_back(std::move(program_));
    program_.clear();
  }
  return programs;
}

}  // namespace touchstone::rig
