// Finds programs in the text that comes in on the primary and secondary interfaces.
#pragma once

#include <string>
#include <vector>

namespace touchstone::rig {

class ProgramReader {
 public:
  // Takes what has come; returns the programs that are complete: from `def` or `sec` to its `end`,
  // or single lines.
  std::vector<std::string> Feed(const std::string& bytes);

 private:
  std::string line_, program_;
  int depth_ = 0;
};

}  // namespace touchstone::rig
