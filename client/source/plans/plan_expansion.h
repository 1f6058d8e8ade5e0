// The commanded touches of a plan for several objects, numbered through.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/statusor.h>

#include "client/source/connection/connection.h"
#include "client/source/dataset/measurement_csv.h"

namespace touchstone::client {

// The touches of every object, in their order, with what the source said of them.
struct PlannedTouches {
  std::vector<MeasuredTouch> touches;
  // By object; none of a list's.
  std::vector<std::pair<std::string, v1::PlanDraws>> draws;
  std::vector<std::string> notes;  // each once
};

// Touches first .. first + count - 1 of the plan in `request` for each object in turn; their numbers begin at `first`, and
// session_time_s is a touch's number times the plan's interval, over all objects. A plan that ends sooner gives fewer. `request` names no object and no part. `progress` is told how many of how many are done.
absl::StatusOr<PlannedTouches> ExpandPlan(Connection* connection, const std::vector<std::string>& objects,
                                          uint64_t first, uint64_t count, v1::ExpandPlanRequest request,
                                          const std::function<void(uint64_t, uint64_t)>& progress = {});

}  // namespace touchstone::client
