// Numbers, units and sentences of a report, as terminal and page both show them. Plain ASCII ("+-", "us",
// "->"); the page sets them in type (html_page.h).
#pragma once

#include <string>
#include <vector>

#include "server/base/readable_time.h"
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

// Three figures, so that columns of times line up (TimeInWords of base/readable_time.h drops trailing zeros).
std::string Time(double us);                           // "41.0 ms", "850 us"
std::string SignedTime(double us);                     // "+9.10 ms"
std::string TimeChange(double from_us, double to_us);  // "41.0 -> 5.0 ms"
// The error on touches that the fit did not see; where none was found, on those that it saw.
double UnseenError(double heldout_us, double rmse_us);
std::string Probability(double p);                                        // "0.40", "3e-9", "< 1e-15"
std::string EffectProbability(double p);                                  // "0.97", "< 0.01", "> 0.99"
std::string Share(double share);                                          // "98.5 %"
std::string Covariate(const std::string& name, const std::string& unit);  // "incidence (deg)"

// "2.98 +- 0.02 mm": as many digits as the error allows. Times in the unit for people.
std::string ValueWithError(const v1::ParameterValue& value);
// "2.94 to 3.02 mm", or empty if the report has no interval.
std::string Interval(const v1::ParameterValue& value);
// "radius_mm", with the finger, axis and object: "latency_us of finger l", "translation_mm x, lat10".
std::string ParameterName(const v1::ParameterValue& value);

// "a", "a or b", "a, b or c".
std::string Join(const std::vector<std::string>& words, const std::string& last);
// "tip_radius or object_scale": a step with its equivalents.
std::string StepName(const v1::Step& step);

// The noise floor, from wherever the report has it, and whether it is only an upper bound; 0: unknown.
struct Floor {
  double sigma = 0;  // us, or grey levels of photographs (error_scale.h)
  bool bound = false;
};
Floor NoiseFloorOf(const v1::Report& report);
// "0.10 mm at 20 mm/s", or a range when there are several speeds; empty without speeds.
std::string LengthOf(double us, const v1::Report& report);

// One rung of the ladder.
struct Rung {
  enum Kind { kGiven, kRefit, kStep, kSuggestion, kFloor };
  Kind kind;
  std::string name;
  double rmse;           // us, or grey levels of photographs
  double heldout_rmse;   // NaN: none
  double lack_of_fit_p;  // NaN: none
};
// The given model, what was changed, and the noise floor; empty for a set without poses.
std::vector<Rung> Ladder(const v1::Report& report);

// Pairs that no step names as its equivalents.
std::vector<const v1::Ambiguity*> OtherAmbiguities(const v1::Report& report);
// "To decide: a second speed", or the text itself if it is a sentence.
std::string ToDecide(const std::string& discriminating_measurement);
// The report's own summary where its parts do not say the same at more length: without a ladder.
std::string SummaryToShow(const v1::Report& report);

// "columns of the fingers (l <-> m)": what kind of mistake a file has.
std::string ProblemTitle(const v1::DataProblem& problem);

// "incidence" of incidence_deg, "session time" of session_time_s.
std::string CovariateName(const std::string& name);
// "6.9 times the floor: 97.9 % of the error is the model's, not noise", as the verdict allows to say; empty
// without a floor.
std::string TimesTheFloor(const v1::Report& report);
// What one noise for all fingers does not explain; empty if nothing.
std::string FingerScatterWords(const v1::Report& report);
// Curves over the place in the session, which are tested finger by finger.
std::vector<const v1::CovariateCurve*> SessionCurves(const v1::Report& report);
// "it looks most like tip_radius (cosine 0.93; 1 would be the same)", or that nothing does; empty if unknown.
std::string NearestEffectWords(const v1::Unexplained& rest);
// A step's name that is never long: "oblique_slip or 3 others".
std::string RungName(const v1::Step& step);
// "about 9 such touches to a verdict (6 nats)", or empty.
std::string VerdictTouches(const v1::ProposedTouch& touch);
// The same of a picture: "about 3 such pictures to a verdict (6 nats)".
std::string VerdictPictures(const v1::ProposedPhotograph& picture);

// A command over as many lines as it needs, so that a shell takes them as one.
std::string ShellLines(const std::string& command, int columns);

// The verdict in one sentence.
std::string Headline(const v1::Report& report);

// "960 touches, 5 objects, 240 poses x 4 rounds"; `times` is the sign between poses and rounds.
std::string DataInWords(const v1::Report& report, const std::string& times);

}  // namespace touchstone::client
