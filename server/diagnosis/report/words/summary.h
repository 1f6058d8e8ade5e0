// What a diagnosis says in sentences, whatever was measured.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis::report {

// An error of this kind for people: "41 ms", "12 grey levels", "0.31 px".
std::string ErrorInWords(DataKind kind, double error);

// "radius_mm 1.5 +- 0.005 mm, ..."; only how many where they are many.
std::string ValuesInWords(const std::vector<engine::ParameterEstimate>& parameters);

// That an emulator made the data, or some; empty: it did not.
std::string EmulatedInWords(const DataReport& data);

// What limits what the data say: few objects, no repeats, few measurements, an emulator.
std::vector<std::string> DataWarnings(const DataReport& data);

// One paragraph: how wrong, why, what to do. Of a diagnosis with one entry of data. `others_in_place`: effects that were
// found elsewhere are in the model already.
std::string Summarize(const Diagnosis& diagnosis, bool others_in_place = false);

// What changed between sessions, and whether the poses that they share agree: a few sentences.
// `unexplained`: sessions with a rest under their own models.
std::string SessionsInWords(const Sessions& sessions, const std::vector<DataReport>& data,
                            const std::vector<int>& unexplained);
// An effect that one session asks for beside what all sessions show.
struct AskedByOne {
  int session = 0;  // place in Diagnosis::data
  std::string effect;
};
// One paragraph of several sessions: how wrong in each, what is missing, what changed.
std::string SummarizeSessions(const Diagnosis& diagnosis, const std::vector<AskedByOne>& asked);
// What messages call the session: its file's name, or its path where two files have one name.
std::string SessionName(const std::vector<DataReport>& data, int session);

// "radius_mm 1.5 +- 0.005 mm".
std::string ValueInWords(const engine::ParameterEstimate& value);

}  // namespace touchstone::diagnosis::report
