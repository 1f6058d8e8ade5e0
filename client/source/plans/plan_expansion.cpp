#include "client/source/plans/plan_expansion.h"

#include <algorithm>

#include "server/base/status.h"

namespace touchstone::client {
namespace {

// Touches that one request asks for.
constexpr uint32_t kPlannedPerRequest = 10000;

void Add(const v1::PlanDraws& more, v1::PlanDraws* draws) {
  draws->set_draws(draws->draws() + more.draws());
  draws->set_no_surface(draws->no_surface() + more.no_surface());
  draws->set_start_blocked(draws->start_blocked() + more.start_blocked());
  draws->set_finger_missed(draws->finger_missed() + more.finger_missed());
  draws->set_beyond_stroke(draws->beyond_stroke() + more.beyond_stroke());
  draws->set_steep_incidence(draws->steep_incidence() + more.steep_incidence());
}

}  // namespace

absl::StatusOr<PlannedTouches> ExpandPlan(Connection* connection, const std::vector<std::string>& objects,
                                          uint64_t first, uint64_t count, v1::ExpandPlanRequest request,
                                          const std::function<void(uint64_t, uint64_t)>& progress) {
  PlannedTouches planned;
  for (const std::string& object : objects) {
    request.set_object(object);
    v1::PlanDraws draws;
    for (uint64_t done = 0; done < count;) {
      const uint32_t step = static_cast<uint32_t>(std::min<uint64_t>(count - done, kPlannedPerRequest));
      request.set_first_index(first + done);
      request.set_count(step);
      if (progress) progress(planned.touches.size(), count * objects.size());
      TOUCHSTONE_ASSIGN_OR_RETURN(const v1::ExpandPlanResponse response,
                                  connection->Call(&v1::Source::Stub::ExpandPlan, request));
      for (const v1::CommandedTouch& touch : response.touches()) {
        MeasuredTouch row;
        row.touch = first + planned.touches.size();
        row.object = object;
        row.commanded = touch;
        // One session: its clock goes on where the source, which knows of one object, begins anew. A list has its own times.
        if (!request.plan().has_list() && request.plan().touch_interval_s() > 0)
          row.commanded.set_session_time_s(row.touch * request.plan().touch_interval_s());
        planned.touches.push_back(std::move(row));
      }
      Add(response.draws(), &draws);
      for (const std::string& note : response.notes())
        if (std::find(planned.notes.begin(), planned.notes.end(), note) == planned.notes.end())
          planned.notes.push_back(note);
      if (response.touches_size() == 0) break;  // the plan has ended
      done += step;
    }
    if (draws.draws() > 0) planned.draws.emplace_back(object, draws);
  }
  return planned;
}

}  // namespace touchstone::client
