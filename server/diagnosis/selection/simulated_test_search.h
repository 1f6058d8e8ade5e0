// The search of a simulated set (simulated_test_set.h), prepared as far as terms and curves are scored.
#pragma once

#include <memory>

#include "server/diagnosis/selection/selection.h"
#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis::selection {

struct TestSearch {
  std::unique_ptr<Workspace> workspace;
  engine::Fit fit;              // of the model as it was given
  touches::Prediction details;  // of the same model, with what covariates need
};

// A rig with these effects hidden, three objects of six touches a face.
inline TestSearch PrepareTestSearch(
    const std::vector<std::pair<std::string, std::vector<std::string>>>& hidden, uint64_t seed = 1) {
  touches::HiddenRig rig;
  rig.samples_per_face = 6;
  rig.hidden = hidden;
  rig.seed = seed;
  TestSearch search;
  absl::StatusOr<std::unique_ptr<Workspace>> workspace = MakeWorkspace(touches::MakeTestInput(rig), {});
  EXPECT_TRUE(workspace.ok()) << workspace.status();
  search.workspace = *std::move(workspace);
  EXPECT_TRUE(PrepareSearch(search.workspace.get(), {}).ok());
  absl::StatusOr<engine::Fit> fit = engine::FitModel(
      search.workspace->experiment,
      engine::Parameterization(*search.workspace->input.model, search.workspace->searched->objects));
  EXPECT_TRUE(fit.ok()) << fit.status();
  search.fit = *std::move(fit);
  absl::StatusOr<touches::Prediction> details =
      search.workspace->searched_predictor->Run(search.fit.model.base(), true, true);
  EXPECT_TRUE(details.ok()) << details.status();
  search.details = *std::move(details);
  return search;
}

struct Selected {
  std::unique_ptr<Workspace> workspace;
  SelectionResult result;
};

inline Selected SelectFor(const DiagnosisInput& input) {
  auto workspace = MakeWorkspace(input, {});
  EXPECT_TRUE(workspace.ok()) << workspace.status();
  auto result = SelectExplanation(workspace->get());
  EXPECT_TRUE(result.ok()) << result.status();
  return {*std::move(workspace), *std::move(result)};
}

}  // namespace touchstone::diagnosis::selection
