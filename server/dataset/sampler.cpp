#include "server/dataset/sampler.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/base/status.h"
#include "server/base/threads/thread_pool.h"
#include "server/touch/batch_row.h"
#include "server/touch/plan_drawer.h"

namespace touchstone::dataset {
namespace {

// Touches that go through the stages together: their arrays stay in the second-level cache.
constexpr size_t kBlock = 512;
// After this many rounds of misses one index is followed to its end, so that a hopeless object fails at once.
constexpr uint32_t kProbeAfter = 16;

}  // namespace

TouchSampler::TouchSampler(const DatasetSpecification& specification)
    : specification_(specification), rig_(specification.model), check_(specification.plan) {
  if (specification.columns.std_uncertainty)
    predicted_ = std::make_unique<const uncertainty::PredictedTimes>(specification.posterior);
  if (specification.draw_models)
    draws_ = std::make_unique<const uncertainty::ModelDraws>(specification.posterior, specification.seed);
  generators_ = touch::MakePoseGenerators(specification.plan, specification.objects, specification.seed);
  plan_ends_ = generators_[0]->Count() != 0;
  const std::vector<touch::CommandedTouch>& list = specification.plan.list;
  if (specification.plan.kind == touch::Plan::Kind::kList)
    for (const std::string& name : rig_.simulator.needed_covariates())
      if (std::all_of(list.begin(), list.end(),
                      [&](const touch::CommandedTouch& touch) { return touch.covariates.count(name) != 0; }))
        list_covariates_.push_back(name);
}

TouchSampler::~TouchSampler() = default;

uint64_t TouchSampler::NumberOf(uint64_t index) const {
  return PlanNumber(index, specification_.objects.size(), plan_ends_);
}

absl::StatusOr<std::shared_ptr<const model::Model>> TouchSampler::ModelOf(uint64_t index) const {
  if (draws_ == nullptr) return rig_.model;
  TOUCHSTONE_ASSIGN_OR_RETURN(uncertainty::ModelDraws::Draw draw, draws_->Of(index));
  return std::move(draw.model);
}

absl::Status TouchSampler::Sample(absl::Span<const uint64_t> indices, const std::atomic<bool>& cancelled,
                                  Workspace* workspace, const Sink& sink) const {
  if (draws_ != nullptr) return SampleDrawn(indices, cancelled, workspace, sink);
  return SampleWith(rig_, indices, cancelled, workspace, sink);
}

// One by one: no two have the same model. The touch before a sample is made by the sample's own model.
absl::Status TouchSampler::SampleDrawn(absl::Span<const uint64_t> indices, const std::atomic<bool>& cancelled,
                                       Workspace* workspace, const Sink& sink) const {
  for (size_t slot = 0; slot < indices.size(); ++slot) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const uncertainty::ModelDraws::Draw draw, draws_->Of(indices[slot]));
    const uint32_t slots[] = {static_cast<uint32_t>(slot)};
    TOUCHSTONE_RETURN_IF_ERROR(
        SampleWith(Rig(draw.model), indices.subspan(slot, 1), cancelled, workspace, [&](const Block& block) {
          sink({block.batch, slots, block.accepted, block.poses, block.attempt, block.uncertainty,
                draw.values});
        }));
  }
  return absl::OkStatus();
}

absl::Status TouchSampler::SampleWith(const Rig& rig, absl::Span<const uint64_t> indices,
                                      const std::atomic<bool>& cancelled, Workspace* workspace,
                                      const Sink& sink) const {
  if (!rig.simulator.needs_previous_press())
    return Run(rig, indices, Until::kSensor, {}, cancelled, workspace, sink);

  // The touch before is the sample before: its motion is simulated first (TouchSimulator::Run).
  const int fingers = specification_.model->fingers;
  std::vector<uint64_t>& previous = workspace->previous_indices;
  std::vector<uint32_t> slot_of_previous;
  previous.clear();
  for (size_t slot = 0; slot < indices.size(); ++slot) {
    if (indices[slot] == 0) continue;
    previous.push_back(indices[slot] - 1);
    slot_of_previous.push_back(slot);
  }
  std::vector<double>& press_m = workspace->previous_press_m;
  press_m.assign(indices.size() * fingers, 0.0);
  TOUCHSTONE_RETURN_IF_ERROR(
      Run(rig, previous, Until::kMotion, {}, cancelled, workspace, [&](const Block& block) {
        for (int touch = 0; touch < block.batch.size(); ++touch)
          for (int finger = 0; block.accepted[touch] && finger < fingers; ++finger)
            press_m[slot_of_previous[block.slots[touch]] * fingers + finger] =
                block.batch.press_m[block.batch.At(finger, touch)];
      }));
  return Run(rig, indices, Until::kSensor, press_m, cancelled, workspace, sink);
}

absl::Status TouchSampler::Run(const Rig& rig, absl::Span<const uint64_t> indices, Until until,
                               absl::Span<const double> previous_press_m, const std::atomic<bool>& cancelled,
                               Workspace* workspace, const Sink& sink) const {
  const size_t objects = specification_.objects.size();
  for (size_t object = 0; object < objects; ++object) {
    workspace->slots.clear();
    workspace->slots.reserve(indices.size());
    for (size_t slot = 0; slot < indices.size(); ++slot)
      if (objects == 1 || indices[slot] % objects == object) workspace->slots.push_back(slot);
    TOUCHSTONE_RETURN_IF_ERROR(
        RunObject(rig, object, indices, until, previous_press_m, cancelled, workspace, sink));
  }
  return absl::OkStatus();
}

absl::Status TouchSampler::RunObject(const Rig& rig, size_t object, absl::Span<const uint64_t> indices,
                                     Until until, absl::Span<const double> previous_press_m,
                                     const std::atomic<bool>& cancelled, Workspace* workspace,
                                     const Sink& sink) const {
  for (uint32_t attempt = 0; !workspace->slots.empty(); ++attempt) {
    const std::vector<uint32_t>& slots = workspace->slots;
    const size_t pending = slots.size();
    if (attempt == kProbeAfter || attempt == specification_.max_draws)
      TOUCHSTONE_RETURN_IF_ERROR(FollowToTheEnd(rig, object, indices[slots[0]], cancelled));
    // What the index's own number or time changes (a formula) shows only here.
    if (attempt == specification_.max_draws)
      return absl::FailedPreconditionError(absl::StrCat("sample ", indices[slots[0]], ": none of ", attempt,
                                                        " draws is a touch of the plan; raise max_draws"));

    // Draw all to find the order that keeps neighbours together. Drawing a pose again is cheaper than
    // fetching it from a large array in that order.
    std::vector<uint32_t>& block = workspace->block_slots;
    for (size_t begin = 0; begin < pending; begin += kBlock) {
      block.assign(slots.begin() + begin, slots.begin() + std::min(pending, begin + kBlock));
      DrawBlock(object, indices, attempt, workspace);
      if (begin == 0) workspace->order.Begin(workspace->poses);
      workspace->order.Add(workspace->poses);
    }
    const absl::Span<const uint32_t> order = workspace->order.Sort();

    // Simulate block by block; what missed is drawn again.
    workspace->missed.clear();
    for (size_t begin = 0; begin < pending; begin += kBlock) {
      if (cancelled.load(std::memory_order_relaxed)) return absl::CancelledError("the stream was cancelled");
      ThreadPool::GiveWay();
      block.clear();
      const absl::Span<const uint32_t> places = order.subspan(begin, kBlock);
      if (pending == indices.size())  // none is done yet: every place is its own slot
        block.assign(places.begin(), places.end());
      else
        for (const uint32_t place : places) block.push_back(slots[place]);
      DrawBlock(object, indices, attempt, workspace);
      TOUCHSTONE_RETURN_IF_ERROR(RunBlock(rig, object, indices, until, previous_press_m, workspace));
      const bool predicts = predicted_ != nullptr && until == Until::kSensor;
      sink({workspace->batch,
            block,
            workspace->accepted,
            workspace->poses,
            attempt,
            predicts ? &workspace->uncertainty : nullptr,
            {}});
      for (size_t k = 0; k < block.size(); ++k)
        if (!workspace->accepted[k]) workspace->missed.push_back(block[k]);
    }
    // In the order of the slots, so that the probe and the error name the lowest index.
    std::sort(workspace->missed.begin(), workspace->missed.end());
    workspace->slots.swap(workspace->missed);
  }
  return absl::OkStatus();
}

// The poses of workspace->block_slots.
void TouchSampler::DrawBlock(size_t object, absl::Span<const uint64_t> indices, uint32_t attempt,
                             Workspace* workspace) const {
  const size_t size = workspace->block_slots.size();
  workspace->numbers.resize(size);
  workspace->poses.resize(size);
  for (size_t k = 0; k < size; ++k) workspace->numbers[k] = NumberOf(indices[workspace->block_slots[k]]);
  generators_[object]->Draw(workspace->numbers, attempt, workspace->poses.data());
}

absl::Status TouchSampler::RunBlock(const Rig& rig, size_t object, absl::Span<const uint64_t> indices,
                                    Until until, absl::Span<const double> previous_press_m,
                                    Workspace* workspace) const {
  effects::TouchBatch& batch = workspace->batch;
  FillBatch(rig.simulator, object, indices, previous_press_m, *workspace, &batch);
  TOUCHSTONE_RETURN_IF_ERROR(rig.simulator.RunToMotion(&batch, &workspace->touch));
  check_.Check(batch, workspace->poses, &workspace->check, &workspace->flaws);
  workspace->accepted.resize(batch.size());
  for (int touch = 0; touch < batch.size(); ++touch)
    workspace->accepted[touch] = workspace->flaws[touch] == touch::DrawFlaw::kNone;
  if (until == Until::kMotion) return absl::OkStatus();
  TOUCHSTONE_RETURN_IF_ERROR(rig.simulator.RunSensor(&batch, &workspace->touch));
  if (predicted_ == nullptr) return absl::OkStatus();
  return predicted_->Evaluate(
      [&](const touch::TouchSimulator& simulator, effects::TouchBatch* moved) {
        FillBatch(simulator, object, indices, previous_press_m, *workspace, moved);
      },
      &workspace->predicted, &workspace->uncertainty);
}

// Of the sample before, whose touch may be the list's last.
double TouchSampler::PauseBefore(const touch::Plan& plan, uint64_t index) const {
  if (plan.kind != touch::Plan::Kind::kList) return plan.touch_interval_s;
  const auto session_time_s = [&](uint64_t i) {
    return plan.list[NumberOf(i) % plan.list.size()].session_time_s;
  };
  return touch::PauseBetween(session_time_s(index - 1), session_time_s(index));
}

void TouchSampler::FillBatch(const touch::TouchSimulator& simulator, size_t object,
                             absl::Span<const uint64_t> indices, absl::Span<const double> previous_press_m,
                             const Workspace& workspace, effects::TouchBatch* to) const {
  const touch::Plan& plan = specification_.plan;
  const std::vector<uint32_t>& block = workspace.block_slots;
  effects::TouchBatch& batch = *to;
  simulator.Prepare(static_cast<int>(block.size()), &batch);
  batch.surface = specification_.objects[object];
  batch.seed = specification_.seed;
  for (size_t k = 0; k < block.size(); ++k) {
    const touch::TouchPose& pose = workspace.poses[k];
    const uint32_t slot = block[k];
    if (plan.kind == touch::Plan::Kind::kList)
      touch::SetTouch(plan.list[NumberOf(indices[slot]) % plan.list.size()], indices[slot], k, &batch);
    else
      touch::SetTouch(pose, plan.speed_m_s, plan.touch_interval_s * indices[slot], indices[slot], k, &batch);
  }
  for (size_t k = 0; k < block.size(); ++k)
    if (batch.index[k] > 0) batch.pause_s[k] = PauseBefore(plan, batch.index[k]);
  // A covariate that some touch of the list lacks stays out: the simulation says that it is missing.
  for (const std::string& name : list_covariates_) {
    std::vector<double>& values = batch.covariates[name];
    values.resize(block.size());
    for (size_t k = 0; k < block.size(); ++k)
      values[k] = plan.list[NumberOf(batch.index[k]) % plan.list.size()].covariates.at(name);
  }
  if (!previous_press_m.empty())
    for (int finger = 0; finger < batch.fingers(); ++finger)
      for (size_t k = 0; k < block.size(); ++k)
        batch.previous_press_m[batch.At(finger, k)] = previous_press_m[block[k] * batch.fingers() + finger];
}

// All draws of one index at once: the error of an index that none of them can serve.
absl::Status TouchSampler::FollowToTheEnd(const Rig& rig, size_t object, uint64_t index,
                                          const std::atomic<bool>& cancelled) const {
  touch::PlanDrawer drawer(specification_.plan, specification_.objects[object], rig.model,
                           specification_.seed, specification_.max_draws);
  touch::DrawCounts counts;
  const auto is_cancelled = [&] {
    ThreadPool::GiveWay();
    return cancelled.load();
  };
  const absl::Status status = drawer.Draw(NumberOf(index), 0, &counts, is_cancelled).status();
  if (status.ok()) return status;
  return absl::Status(status.code(), absl::StrCat("object '", specification_.objects[object]->name(),
                                                  "', sample ", index, ": ", status.message()));
}

}  // namespace touchstone::dataset
