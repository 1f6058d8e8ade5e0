// Where the measurement files of a rehearsal come from: the product's own simulator, or any program that writes one
// (server/README.md, "A generator of your own").
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/diagnosis/rehearsal.h"
#include "client/source/connection/connection.h"
#include "client/source/dataset/measurement_csv.h"
#include "server/source/object_store.h"

namespace touchstone::cli {

// One session of a set.
struct FileToMake {
  const std::vector<client::MeasuredTouch>* plan = nullptr;
  const RehearsedCase* hidden = nullptr;
  int session = 0, sessions = 1;
  uint64_t seed = 0;  // another one for every file
};

class RehearsedFiles {
 public:
  virtual ~RehearsedFiles() = default;
  // The text of a measurement file of the plan's touches, without the case's mistake; none: this source cannot hide the case.
  virtual absl::StatusOr<std::optional<std::string>> Make(const FileToMake& file) = 0;
};

// By Source.Touch of the connection, which must outlive it.
std::unique_ptr<RehearsedFiles> SimulatedFiles(client::Connection* connection);

inline constexpr double kGeneratorLimitS = 60;
inline constexpr int kCannotHide = 3;  // exit status of a generator

struct GeneratorOptions {
  std::string program;  // a path, or a name in PATH
  double limit_s = kGeneratorLimitS;
  std::vector<source::MeshSpec> meshes;  // that it is told of
};
// NOT_FOUND: there is no such program.
absl::StatusOr<std::unique_ptr<RehearsedFiles>> GeneratedFiles(const GeneratorOptions& options);

// What --hide says of each hidden effect: "tip_radius radius_mm=1.5", or "outside".
std::vector<std::string> HiddenInWords(const RehearsedCase& hidden);

// A measurement file in which the first two fingers are exchanged.
std::string WithFingersExchanged(const std::string& csv);

}  // namespace touchstone::cli
