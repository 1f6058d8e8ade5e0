// Numbers, units and sentences of a report, as terminal and page both show them. Plain ASCII ("+-", "us",
// "->"); the page sets them in type.
#pragma once

#include <string>
#include <vector>

#include "server/base/text/readable_time.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::client {

// `digits` significant digits, no exponent between 1e-4 and 1e7: "41.0", "0.012", "3e-9"; "n/a" for NaN.
std::string Number(double value, int digits = 3);
// With `decimals` decimals; never "-0.0".
std::string Fixed(double value, int decimals);
// A round number as it is: "20", "0.05", "-3e-9".
std::string Tick(double value);
// Whole numbers of at least five digits in groups: "1 000 000".
std::string Count(uint64_t count);

// Three figures, so that columns of times line up (TimeInWords of base/text/readable_time.h drops trailing zeros).
std::string Time(double us);                                              // "41.0 ms", "850 us"
std::string SignedTime(double us);                                        // "+9.10 ms"
std::string TimeChange(double from_us, double to_us);                     // "41.0 -> 5.0 ms"
std::string Probability(double p);                                        // "0.40", "3e-9", "< 1e-15"
std::string EffectProbability(double p);                                  // "0.97", "< 0.01", "> 0.99"
std::string Share(double share);                                          // "98.5 %"
std::string Covariate(const std::string& name, const std::string& unit);  // "incidence (deg)"

// "1.7 ms", "0.042 mm": `digits` significant digits. Times in the unit for people.
std::string SizeInUnit(double value, const std::string& unit, int digits = 2);
// "2.98 +- 0.02 mm": as many digits as the error allows. Times in the unit for people.
std::string ValueWithError(double value, double std_error, const std::string& unit);
std::string ValueWithError(const v1::ParameterValue& value);
// "2.94 to 3.02 mm", or empty if the report has no interval.
std::string Interval(const v1::ParameterValue& value);
// "radius_mm", with the finger, axis and object: "latency_us of finger l", "translation_mm x, lat10".
std::string ParameterName(const v1::ParameterValue& value);

// "a", "a or b", "a, b or c".
std::string Join(const std::vector<std::string>& words, const std::string& last);
// "tip_radius or object_scale": a step with its equivalents.
std::string StepName(const v1::Step& step);

// The entry that headline and ladder tell of: the only one, or of a joint report the photographs, since every picture has
// thousands of readings. Empty where the report has none.
const v1::DataReport& MainData(const v1::Report& report);
// The entry that a problem's errors belong to.
const v1::DataReport& DataOf(const v1::Report& report, const v1::DataProblem& problem);
// Whether the report has errors of several kinds of measurement, or of several sessions.
bool IsJoint(const v1::Report& report);
// Whether the report is of a plan (touchstone check): nothing was measured.
bool IsOfPlan(const v1::Report& report);
// Of the summary, with its full stop.
std::string FirstSentence(const v1::Report& report);
// "Touches", "Photographs": a heading where there are several.
std::string KindName(v1::DataReport::Kind kind);

// The noise floor, and whether it is only an upper bound; 0: unknown.
struct Floor {
  double sigma = 0;  // in the unit of the entry
  bool bound = false;
};
Floor NoiseFloorOf(const v1::DataReport& data);
// " Noise floor 5.00 ms (0.10 mm at 20 mm/s), from 720 repeats."; empty if it is unknown. `of`: " of the touches", where there are
// several kinds.
std::string NoiseFloorSentence(const v1::DataReport& data, const std::string& of = "");
// That of MainData; of a joint report a sentence for each kind.
std::string NoiseFloorSentences(const v1::Report& report);

// One rung of the ladder.
struct Rung {
  enum Kind { kGiven, kRefit, kStep, kSuggestion, kFloor };
  Kind kind;
  std::string name;
  double rmse;           // in the unit of the entry
  double heldout_rmse;   // NaN: none
  double lack_of_fit_p;  // NaN: none
};
// The given model, what was changed, and the noise floor, of one entry of the report; empty for a set without poses.
std::vector<Rung> Ladder(const v1::Report& report, const v1::DataReport& data);

// Pairs that no step names as its equivalents.
std::vector<const v1::Ambiguity*> OtherAmbiguities(const v1::Report& report);
// What the discriminating measurement of a step tells from what: "To tell exposure from the albedo of all objects". The others
// are its equivalents, or whatever the report's ambiguities name beside it; "a cause without a name" where neither has any.
std::string WhatToTell(const v1::Report& report, const v1::Step& step);
// "To decide: a second speed", or the text itself if it is a sentence.
std::string ToDecide(const std::string& discriminating_measurement);
// The report's own summary where its parts do not say the same at more length: without a ladder.
std::string SummaryToShow(const v1::Report& report);

// "finger_order": the kind's name as commands have it.
std::string ProblemName(const v1::DataProblem& problem);
// "columns of the fingers (l <-> m)": what kind of mistake a file has.
std::string ProblemTitle(const v1::DataProblem& problem);

// "incidence" of incidence_deg, "session time" of session_time_s.
std::string CovariateName(const std::string& name);
// "6.9 times the floor: 97.9 % of the error is the model's, not noise", as the verdict allows to say of this entry; empty
// without a floor.
std::string TimesTheFloor(const v1::Report& report, const v1::DataReport& data);
// What one noise for all fingers of touches does not explain; empty if nothing.
std::string FingerScatterWords(const v1::Report& report);
// "l +9.10 ms, m -850 us": the mean residual of each finger; empty if the entry has none.
std::string FingerBiasWords(const v1::DataReport& data);
// Curves over the place in the session, which are tested finger by finger.
std::vector<const v1::CovariateCurve*> SessionCurves(const v1::DataReport& data);
// "it looks most like tip_radius (cosine 0.93; 1 would be the same)", or that nothing does; empty if unknown.
std::string NearestEffectWords(const v1::Unexplained& rest);
// A step's name that is never long: "oblique_slip or 3 others".
std::string RungName(const v1::Step& step);
// "about 9 such touches to a verdict (6 nats)", "about 3 such pictures ...", or empty.
std::string CountToVerdict(const v1::NextMeasurement& next);

// A command over as many lines as it needs, so that a shell takes them as one.
std::string ShellLines(const std::string& command, int columns);

// Whether the given model agrees with the data to what their numbers are rounded to.
bool AgreesToRounding(const v1::DataReport& data);

// "ADEQUATE", as JSON has it; empty for a comparison.
std::string VerdictWord(const v1::Report& report);

// "P(nothing is missing) = 0.31 over 214 hypotheses."; why it was not assessed, where a verdict has none; empty for a comparison.
std::string NothingMissingWords(const v1::Report& report);

// The verdict in one sentence.
std::string Headline(const v1::Report& report);

// What a session of several is called (FileLabel).
std::string SessionLabel(const v1::Report& report, int session);

// "960 touches, 5 objects, 240 poses x 4 rounds", of all entries; `times` is the sign between poses and rounds.
std::string DataInWords(const v1::Report& report, const std::string& times);

}  // namespace touchstone::client
