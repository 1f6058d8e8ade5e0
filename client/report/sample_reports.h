// Reports as a diagnosis would give them, for the tests: consistent in themselves, every field filled that
// the verdict allows. The numbers are made up.
#pragma once

#include <string>
#include <vector>

#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::client {

v1::Report MissingEffectsReport();  // two steps, the first with an equivalent
v1::Report WrongValuesReport();     // contact_slowdown and noise put right
v1::Report AdequateReport();        // nothing to do, no repeats
v1::Report UnexplainedReport();     // a formula suggested
v1::Report CheckDataReport();       // two mistakes that cannot be told apart
v1::Report TooLittleDataReport();   // six touches
v1::Report CompareReport();         // no verdict
v1::Report WithoutPosesReport();    // distributions only
v1::Report JointReport();           // that of missing effects, with photographs

struct NamedReport {
  std::string name;
  v1::Report report;
};
std::vector<NamedReport> AllSampleReports();

}  // namespace touchstone::client
