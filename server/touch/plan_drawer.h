// The touches of a plan around one object, one by one: each drawn until it is one that every finger completes.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include <absl/status/statusor.h>

#include "server/geometry/surface/surface.h"
#include "server/model/model.h"
#include "server/touch/draw_check.h"
#include "server/touch/plan.h"

namespace touchstone::touch {

class PlanDrawer {
 public:
  // `plan` must be valid and outlive the drawer; a list's touches are as they are. `model` decides where the fingers are.
  PlanDrawer(const Plan& plan, std::shared_ptr<const geometry::Surface> surface,
             std::shared_ptr<const model::Model> model, uint64_t seed, uint32_t max_draws);

  struct Drawn {
    CommandedTouch touch;
    uint32_t attempt = 0;  // the draws before it were rejected
  };
  // Touch `number` of the plan: its first draw from `first_attempt` on that has no flaw. A pure function of its
  // arguments and of what the drawer was made with. Every draw is counted in `counts`. FAILED_PRECONDITION: there is
  // none below max_draws; says which condition failed how often and what would help. INVALID_ARGUMENT: the model
  // needs what a plan does not have (a covariate). Not thread-safe.
  // CANCELLED soon after `cancelled`, where there is one, becomes true.
  absl::StatusOr<Drawn> Draw(uint64_t number, uint32_t first_attempt, DrawCounts* counts,
                             const std::function<bool()>& cancelled = nullptr);

  const PoseGenerator& generator() const { return *generator_; }

 private:
  absl::Status Hopeless(const DrawCounts& counts) const;

  const Plan& plan_;
  const std::shared_ptr<const geometry::Surface> surface_;
  const uint64_t seed_;
  const uint32_t max_draws_;
  const TouchSimulator simulator_;
  const DrawCheck check_;
  const std::unique_ptr<PoseGenerator> generator_;
  effects::TouchBatch batch_;
  TouchWorkspace touch_workspace_;
  DrawCheck::Workspace check_workspace_;
  std::vector<DrawFlaw> flaws_;
};

}  // namespace touchstone::touch
