// touchstone diagnose FOLDER --board 9x6 --square-mm 25: the lens by pictures of a chessboard. Always in this process.
#pragma once

#include <string>

#include "client/cli/diagnosis/comparison.h"

namespace touchstone::cli {

struct BoardOptions {
  std::string corners;      // "9x6"; empty: the set is none of boards
  double square_mm = 0;     // must be given with it
  std::string save_camera;  // file; empty: the lens is not written
};

void AddBoardOptions(CLI::App* command, BoardOptions* options);

// `save_model` empty: the improved model is not written.
absl::Status RunBoardDiagnosis(const Cli& cli, const ComparisonOptions& options, const BoardOptions& board,
                               const std::string& save_model);

}  // namespace touchstone::cli
