#include "client/cli/diagnosis/proposed_touches.h"

#include <vector>

#include "client/source/dataset/measurement_csv.h"

namespace touchstone::cli {

std::string PlanOfTouches(const v1::Report& report) {
  std::vector<client::MeasuredTouch> plan;
  for (const v1::NextMeasurement& next : report.next()) {
    client::MeasuredTouch touch;
    touch.touch = plan.size();
    touch.object = next.object();
    touch.commanded = next.touch();
    plan.push_back(std::move(touch));
  }
  return client::FormatMeasurements(plan);
}

}  // namespace touchstone::cli
