// Mistakes in a finished measurement file: discrete, not physics. Each is a transformation of the file's text.
#pragma once

#include <string>
#include <vector>

namespace touchstone::hidden {

enum class DataErrorKind {
  kLateralReversed,
  kApproachReversed,
  kFingersPermuted,  // which: the column that each finger's times are taken from
  kColumnSorted,     // which: a finger whose times were sorted, alone
  kObjectsSwapped,   // which: two objects by their place in the file
  kWrongObject,      // which: one object that bears the name of the other
  kTimeUnits,        // number: the times are written times it
  kLengthUnits,      // number: targets and standoffs are written times it
  kSpeedFactor,      // number: the speeds are written times it
  kObjectLower,      // number: the object stands lower by so many mm than the file has it
  kFrameTurned,      // number: deg about x by which the file's frame stands turned
  kRowsShifted,      // which: by how many rows the times stand too low
  kCopies,           // number: share of the rows; which: how often each of them is there once more
};

struct DataError {
  DataErrorKind kind = DataErrorKind::kLateralReversed;
  double number = 0;
  std::vector<int> which;
};

// The file with the mistake.
std::string WithDataError(const std::string& csv, const DataError& data_error);

// Kinds of v1::DataProblem that say the same: a mistake may have several names, for instance times in tenths and
// speeds ten times as large.
std::vector<std::string> ProblemKinds(const DataError& data_error);

// "speed factor 2".
std::string InWords(const DataError& data_error);

}  // namespace touchstone::hidden
