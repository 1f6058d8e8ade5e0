#include "client/workbench_server/example.h"

#include <vector>

#include "client/source/connection/connection.h"
#include "client/source/dataset/measurement_csv.h"
#include "client/source/plans/session_parts.h"
#include "server/base/status.h"
#include "server/effects/all_effects.h"
#include "server/model/model.h"

namespace touchstone::workbench {
namespace {

constexpr uint64_t kSeed = 7;
constexpr int kTouchesPerObject = 192;  // 6 faces, 8 poses, 4 rounds

}  // namespace

absl::StatusOr<v1::Evidence> ExampleEvidence() {
  TOUCHSTONE_ASSIGN_OR_RETURN(model::Model known, model::AddEffect(model::NominalModel(), "gaussian_noise",
                                                                   {"sigma_us=5000"}, effects::Catalogue()));
  known.name = "example";
  TOUCHSTONE_ASSIGN_OR_RETURN(const model::Model hidden,
                              model::AddEffect(known, "tip_radius", {"radius_mm=2"}, effects::Catalogue()));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, client::Connection::Open({}));
  std::vector<client::MeasuredTouch> touches;
  for (const char* object : {"lat00", "lat10", "lat20"}) {
    v1::ExpandPlanRequest plan;
    plan.set_object(object);
    plan.mutable_plan()->mutable_faces();
    plan.set_count(kTouchesPerObject);
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::ExpandPlanResponse planned,
                                connection->Call(&v1::Source::Stub::ExpandPlan, plan));
    const size_t first = touches.size();
    for (const v1::CommandedTouch& commanded : planned.touches()) {
      touches.emplace_back();
      touches.back().touch = touches.size() - 1;
      touches.back().object = object;
      touches.back().commanded = commanded;
    }
    v1::TouchRequest request = client::PartOfSession(touches, first, kTouchesPerObject);
    request.mutable_model()->set_yaml(model::FormatModel(hidden));
    request.set_seed(kSeed);
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::TouchResponse made,
                                connection->Call(&v1::Source::Stub::Touch, request));
    for (int i = 0; i < made.results_size(); ++i)
      touches[first + static_cast<size_t>(i)].time_s.assign(made.results(i).contact_time_s().begin(),
                                                            made.results(i).contact_time_s().end());
  }
  v1::Evidence evidence;
  evidence.set_csv(client::FormatMeasurements(touches));
  evidence.mutable_model()->set_yaml(model::FormatModel(known));
  evidence.set_origin("the example");
  return evidence;
}

}  // namespace touchstone::workbench
