// The order in which a rig makes the touches of a plan, and its messages. Pure functions, but for CheckRows.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "client/source/connection/connection.h"
#include "client/source/dataset/measurement_csv.h"
#include "touchstone/v1/freedrive.pb.h"

namespace touchstone::client {

// A row of the plan with what its check said.
struct PlannedRow {
  MeasuredTouch touch;
  std::string id;
  bool possible = true;
  std::string reason;   // why not
  std::string up_face;  // of the object, that it needs
  double duration_s = 0;
  std::vector<std::string> notes;  // what does not forbid it: a singularity that it comes near to
};

// Rows (by index) that need the same object lying the same way.
struct RigGroup {
  std::string object, up_face;
  std::vector<size_t> rows;  // in the order of the plan
  double duration_s = 0;
};

// Rows that `take` wants, by object and then by resting face, each in the order of its first row; what lies on
// the fixture already (may be empty) comes first.
std::vector<RigGroup> GroupRows(const std::vector<PlannedRow>& rows, const std::function<bool(size_t)>& take,
                                const std::string& mounted_object, const std::string& mounted_up_face);

// The rows of a plan with their ids; INVALID_ARGUMENT if two have one number for the same object.
absl::StatusOr<std::vector<PlannedRow>> RowsOf(const std::vector<MeasuredTouch>& plan,
                                               const std::string& session, const std::string& origin);

// Checks the rows that `wanted` names (indices), in parts, and fills in what the source says; each row's check, with its path,
// goes to `checks` (may be null). `go_on` is asked between two parts (may be null): CANCELLED where it says no.
absl::Status CheckRows(Connection* connection, const std::vector<size_t>& wanted,
                       std::vector<PlannedRow>* rows, std::vector<v1::TouchCheck>* checks,
                       const std::function<bool()>& go_on = nullptr);

// "Put lat20 on the fixture with its face -x up", or where it lies there already, "Turn lat20 so that its
// face -x points up".
std::string RestingFaceRequest(const std::string& object, const std::string& up_face,
                               const std::string& mounted_object);

// The touch whose contact a guided arm shows: its tip is the target, its axis the approach. FAILED_PRECONDITION without an
// object on the fixture.
absl::StatusOr<MeasuredTouch> TaughtTouch(const v1::GuideState& state, uint64_t number, double standoff_m,
                                          double speed_m_s);

// The standard deviation of one finger's contact time among repeats of the same touch, seconds: what no pose
// explains. Only whole touches count. NaN without repeats.
double NoiseOfRepeats(const std::vector<MeasuredTouch>& touches);

}  // namespace touchstone::client
