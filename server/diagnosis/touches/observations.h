// What takes part in a diagnosis: the touches of a set that can be compared, grouped by object and pose.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/input.h"

namespace touchstone::diagnosis::touches {

// Touches k = 0 .. size()-1 in the order of the session (session time if there is one, else the file's
// order).
struct Observations {
  std::shared_ptr<const session::MeasurementSet> set;
  int fingers = 0;
  std::vector<std::string> objects;                                // as in the set
  std::vector<std::shared_ptr<const geometry::Surface>> surfaces;  // one per object
  std::vector<int> row;                                            // touch -> row of the set
  std::vector<int> object;                                         // touch -> index into objects
  std::vector<int> pose;  // touch -> group of equal commanded touches, numbered by first appearance
  int poses = 0;
  std::vector<double> time_s;  // [k * fingers + finger], NaN: not reported
  std::vector<char> used;      // 0: left out of every fit and error (edge contacts, outliers, ...)
  std::vector<int> previous;   // the session's previous touch; -1: none
  std::map<std::string, std::vector<int>> unused;  // touches k by the reason why they are left out

  int size() const { return static_cast<int>(row.size()); }
};

// Checks that set, model and surfaces belong together. Errors name what is missing.
absl::StatusOr<Observations> MakeObservations(const DiagnosisInput& input);

// The covariate of a touch's place in the session: "session_time_s", or "touch" without session times.
const char* NameOfTime(const Observations& observations);

// Time since the session's previous touch; 0 for the first and without session times.
double PauseS(const Observations& observations, int k);

// The round of each touch: as the set numbers it, else how often its pose came before. [k]
std::vector<int> RoundsOfTouches(const Observations& observations);

// The reason of touches that miss the object, or all but miss an edge of it, in the model at hand.
inline constexpr char kMissedReason[] =
    "in the model fewer than two of the reporting fingers meet the object";
inline constexpr char kEdgeReason[] =
    "a finger meets the object within 0.3 mm of an edge that another would pass";

// The reason of touches with a finger whose time no noise explains.
inline constexpr char kOutlierReason[] =
    "an outlier: one finger's time is far from what all other touches allow";

// The reason of touches whose fingers' contacts lie farther apart along the approach than the object is thick.
inline constexpr char kImpossibleReason[] =
    "a reading that is impossible: two fingers' contacts lie farther apart than the object is thick";

// Takes touch k out, with the reason in words for people ("a finger within 0.3 mm of an edge").
void LeaveOut(Observations* observations, int k, const std::string& reason);

// Touches that were left out for the reason.
std::vector<int> LeftOutFor(const Observations& observations, const std::string& reason);

}  // namespace touchstone::diagnosis::touches
