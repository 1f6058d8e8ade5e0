// What a set consists of, and what of it takes part.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::touches {

// Touches that were left out for one reason.
struct UnusedTouches {
  int count = 0;
  std::vector<uint64_t> examples;  // the first few, by touch number
};

struct DataSummary {
  std::string origin;  // what messages call the set: the path
  int fingers = 0;
  int rows = 0;                                 // of the file
  std::map<std::string, UnusedTouches> unused;  // by reason
  int outliers = 0;                             // among the unused
  std::vector<std::string> objects;
  // Of the touches that take part.
  int touches = 0;
  int poses = 0;                    // different commanded touches
  int repeats = 0;                  // touches beyond the first of their pose
  int rounds = 0;                   // 0 if the file has none
  std::vector<double> speeds_mm_s;  // at most the first 20
  int missed_contacts = 0;          // of all touches
};

DataSummary SummarizeData(const Observations& observations);

}  // namespace touchstone::diagnosis::touches
