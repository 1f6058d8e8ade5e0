// Whether a report is right, measure by measure.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/diagnose.h"
#include "server/diagnosis/report/message/write_report.h"
#include "tests/hidden_effects/score/arms/arms.h"

namespace touchstone::hidden {

// One answer to one question of the table: "false claim", "right first", ...
struct Mark {
  std::string measure;
  bool yes = false;
};

// What the report says of the touches; empty where it says nothing.
const v1::DataReport& TouchEntry(const v1::Report& report);
// "finger_order".
std::string KindOf(const v1::DataProblem& problem);

// Marks of the diagnosis of one set. `formula_cuts_to`: what the suggested formula leaves of the mean square
// misfit on fresh touches, as a share; NaN without a formula.
std::vector<Mark> Judge(const Arm& arm, const Scenario& truth, const v1::Report& report,
                        double formula_cuts_to);

// Marks of a method that only names effects, in the order of its choice.
std::vector<Mark> JudgeNames(const Arm& arm, const Scenario& truth, const std::vector<std::string>& names);

// "oblique_slip 0.31; object_push 0.2", "nothing", "unlisted lead_screw 0.1 4.2".
std::string TruthInWords(const Scenario& truth);
// "MISSING_EFFECTS oblique_slip [= ...] travel_mm=0.30+-0.01".
std::string ReportInWords(const v1::Report& report);

}  // namespace touchstone::hidden
