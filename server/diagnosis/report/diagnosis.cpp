#include "server/diagnosis/report/diagnosis.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>

namespace touchstone::diagnosis::report {

const char* UnitOf(DataKind kind) {
  switch (kind) {
    case DataKind::kTouches:
    case DataKind::kDistributions:
      return "us";
    case DataKind::kPhotographs:
      return "grey";
    case DataKind::kBoards:
      return "px";
  }
  return "";
}

int SetAside::count() const {
  int sum = 0;
  for (const Rows& one : rows) sum += one.count;
  return sum;
}

void SetNothingMissing(const std::optional<engine::NothingMissing>& found, Diagnosis* diagnosis) {
  diagnosis->p_nothing_missing.reset();
  diagnosis->hypotheses_tried = found ? found->hypotheses : 0;
  if (found) diagnosis->p_nothing_missing = found->p;
}

void AddImprovement(const engine::Improvement& improvement, Diagnosis* diagnosis) {
  DataReport& data = diagnosis->data[0];
  diagnosis->verdict = improvement.verdict;
  diagnosis->refitted = improvement.refitted;
  for (const engine::LadderStep& step : improvement.steps) {
    diagnosis->steps.push_back({step, {}});
    data.after_step.push_back(step.quality);
  }
  diagnosis->superfluous = improvement.superfluous;
  diagnosis->confounded = improvement.confounded;
  data.candidates = improvement.candidates;
  data.unexplained = improvement.unexplained;
  if (improvement.changed) diagnosis->improved_model = improvement.improved;
}

void SetCopiesAside(const std::vector<std::string>& files, Diagnosis* diagnosis) {
  if (files.empty()) return;
  constexpr char kReason[] = "the same picture as another";
  diagnosis->data[0].set_aside.rows.push_back({kReason, static_cast<int>(files.size()), {}});
  diagnosis->warnings.push_back(absl::StrCat(kReason, ", counted once: ", absl::StrJoin(files, ", ")));
}

double ReducibleShare(const NoiseFloor& floor, double rmse) {
  return rmse > 0 ? std::clamp(1 - floor.sigma * floor.sigma / (rmse * rmse), 0.0, 1.0) : 0;
}

}  // namespace touchstone::diagnosis::report
