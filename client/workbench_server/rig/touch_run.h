// A plan's touches at a rig, as the page makes them: the dry run first, then, once a person has agreed, touch by touch.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "client/source/connection/leased_source.h"
#include "client/source/plans/rig_plan.h"
#include "client/workbench_server/rig/touch_drawing.h"

namespace touchstone::workbench {

// What a run tells and asks.
struct RunEvents {
  // A touch is done: JSON {"touch", "object", "up_face", "times_us": [one per finger after the first contact, null: none]}.
  std::function<void(std::string)> touched;
  // Waits until a person has done what the words say; an error where the run was stopped meanwhile.
  std::function<absl::Status(const std::string& words)> ask;
  // False: the run is to end before the next touch.
  std::function<bool()> go_on;
};

// What the page asked for: {"session": NAME, and either "csv": TEXT, "origin": FILE or "objects": [NAME, ..],
// "samples_per_face", "rounds", "speed_mm_s", "max_tilt_deg", "seed"}.
class TouchRun {
 public:
  // Expands and checks; moves nothing, needs no lease. INVALID_ARGUMENT says what is wrong with the plan.
  static absl::StatusOr<std::unique_ptr<TouchRun>> Check(client::Connection* rig, const nlohmann::json& plan,
                                                         const ObjectsOfSource& objects,
                                                         const std::function<bool()>& go_on);

  // Makes the touches that are possible; those that the rig has made under this session are answered from its journal.
  // Touches that are impossible are left out where `skip_impossible` says so, else the run is refused.
  absl::Status TouchAll(client::Connection* rig, client::LeasedSource* source, bool skip_impossible,
                        const RunEvents& events);

  // {"session", "origin", "touches", "possible", "groups": [{"object", "up_face", "touches", "duration_s"}], "duration_s",
  // "impossible": [{"touch", "object", "reason"}], "notes": [..]}: what the dry run found.
  const nlohmann::json& checked() const { return checked_; }
  const std::string& session() const { return session_; }
  // What it would touch, touch_drawing.h.
  const nlohmann::json& drawing() const { return drawing_; }

 private:
  void Summarize(const std::vector<client::RigGroup>& setups);

  std::string session_, origin_;
  std::vector<client::PlannedRow> rows_;
  nlohmann::json checked_, drawing_;
};

}  // namespace touchstone::workbench
