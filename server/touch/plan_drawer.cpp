#include "server/touch/plan_drawer.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/touch/batch_row.h"

namespace touchstone::touch {
namespace {

constexpr uint32_t kDrawsBetweenLooks = 64;

// What would help most against the flaw that was the most frequent. `too_wide`: the fingers span more than the object.
std::string Advice(DrawFlaw flaw, bool too_wide) {
  if (too_wide)
    return "a larger object (scale at import) or a narrower end effector: no draw brings all fingers onto it";
  switch (flaw) {
    case DrawFlaw::kStartBlocked:
      return "a shorter standoff or a smaller max_tilt";
    case DrawFlaw::kBeyondStroke:
      return "a larger stroke_beyond_target or a smaller max_tilt";
    case DrawFlaw::kSteepIncidence:
      return "a larger max_incidence";
    default:
      return "a larger object (scale at import), a narrower end effector, or a higher max_draws";
  }
}

}  // namespace

PlanDrawer::PlanDrawer(const Plan& plan, std::shared_ptr<const geometry::Surface> surface,
                       std::shared_ptr<const model::Model> model, uint64_t seed, uint32_t max_draws)
    : plan_(plan),
      surface_(std::move(surface)),
      seed_(seed),
      max_draws_(max_draws),
      simulator_(std::move(model)),
      check_(plan),
      generator_(MakePoseGenerator(plan, *surface_, seed)) {}

absl::StatusOr<PlanDrawer::Drawn> PlanDrawer::Draw(uint64_t number, uint32_t first_attempt,
                                                   DrawCounts* counts,
                                                   const std::function<bool()>& cancelled) {
  DrawCounts own;
  for (uint32_t attempt = first_attempt; attempt < max_draws_; ++attempt) {
    if (attempt % kDrawsBetweenLooks == 0 && cancelled && cancelled())
      return absl::CancelledError("the request was cancelled");
    CommandedTouch touch = TouchOfPlan(plan_, *generator_, number, attempt);
    if (!generator_->CanRedraw()) return Drawn{std::move(touch), attempt};
    simulator_.Prepare(1, &batch_);
    batch_.surface = surface_;
    batch_.seed = seed_;
    SetTouch(touch, number, 0, &batch_);
    TOUCHSTONE_RETURN_IF_ERROR(simulator_.RunToMotion(&batch_, &touch_workspace_));
    const TouchPose& pose = touch;
    check_.Check(batch_, {&pose, 1}, &check_workspace_, &flaws_);
    own.Add(flaws_[0]);
    counts->Add(flaws_[0]);
    if (flaws_[0] == DrawFlaw::kNone) return Drawn{std::move(touch), attempt};
  }
  return Hopeless(own);
}

absl::Status PlanDrawer::Hopeless(const DrawCounts& counts) const {
  const model::Model& model = simulator_.model();
  const Eigen::Vector3d size_m = surface_->bounds().max_m - surface_->bounds().min_m;
  const auto mm = [](double metres) {
    return ShortestNumber(std::round(FromSi(Unit::kMillimetre, metres) * 10) / 10);
  };
  const double span_m = (model.fingers - 1) * model.spacing_m;
  const auto worst = std::max_element(counts.by_flaw.begin() + 1, counts.by_flaw.end());
  return absl::FailedPreconditionError(
      absl::StrCat("in ", counts.Draws(), " draws no touch met it as the plan wants with all ", model.fingers,
                   " fingers: ", counts.FlawsInWords(plan_), ". The fingers span ", mm(span_m),
                   " mm and the object measures ", mm(size_m.x()), " x ", mm(size_m.y()), " x ",
                   mm(size_m.z()), " mm; what would help: ",
                   Advice(static_cast<DrawFlaw>(worst - counts.by_flaw.begin()), span_m > size_m.norm())));
}

}  // namespace touchstone::touch
