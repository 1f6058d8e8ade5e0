#include "server/diagnosis/touches/predictor.h"

#include <absl/strings/match.h>

#include <algorithm>
#include <cmath>
#include <mutex>

#include "server/base/status.h"
#include "server/touch/batch_row.h"

namespace touchstone {
namespace {

constexpr int kBlock = 1024;

// Whether touches of one pose may differ under this model.
bool HangsOnSession(const Model& model) {
  for (const EffectInstance& instance : model.effects) {
    const Effect& effect = *instance.effect;
    if (effect.needs.previous_press || !effect.needs.covariates.empty() || effect.name == "thermal_drift")
      return true;
    if (effect.formula && absl::StrContains(effect.formula->expression, "session_time")) return true;
  }
  return false;
}

}  // namespace

bool IsRandomEffect(const Effect& effect) {
  for (const char* name : {"gaussian_noise", "incidence_noise", "heavy_tail_noise", "poll_interval",
                           "missed_contact", "surface_error"})
    if (effect.name == name) return true;
  return false;
}

Model DeterministicPart(const Model& model) {
  Model part = model;
  part.effects.erase(
      std::remove_if(part.effects.begin(), part.effects.end(),
                     [](const EffectInstance& instance) { return IsRandomEffect(*instance.effect); }),
      part.effects.end());
  return part;
}

Predictor::Predictor(const Observations& observations, ThreadPool* pool)
    : observations_(observations), pool_(pool), first_of_pose_(observations.poses, -1) {
  std::vector<int> all(observations.size());
  for (int k = 0; k < observations.size(); ++k) {
    all[k] = k;
    int& first = first_of_pose_[observations.pose[k]];
    if (first < 0) first = k;
  }
  pose_blocks_ = MakeBlocks(observations, first_of_pose_);
  touch_blocks_ = MakeBlocks(observations, all);
}

std::vector<Predictor::Block> Predictor::MakeBlocks(const Observations& observations,
                                                    const std::vector<int>& touches) {
  std::vector<Block> blocks;
  std::vector<int> open(observations.objects.size(), -1);  // the block of each object that has room
  for (const int k : touches) {
    const int object = observations.object[k];
    if (open[object] < 0 || blocks[open[object]].touches.size() == kBlock) {
      open[object] = static_cast<int>(blocks.size());
      blocks.push_back({object, {}});
    }
    blocks[open[object]].touches.push_back(k);
  }
  return blocks;
}

void Predictor::Fill(const Block& block, const TouchSimulator& simulator, TouchBatch* batch) const {
  const MeasurementSet& set = *observations_.set;
  const int size = static_cast<int>(block.touches.size());
  simulator.Prepare(size, batch);
  batch->surface = observations_.surfaces[block.object];
  for (int t = 0; t < size; ++t) {
    const int row = observations_.row[block.touches[t]];
    const TouchPose pose = {set.target_m[row], set.approach[row], set.lateral[row], set.standoff_m[row]};
    SetTouch(pose, set.speed_m_s[row], set.session_time_s[row], row, t, batch);
  }
  for (const std::string& name : simulator.needed_covariates()) {
    const auto found = set.covariates.find(name);
    if (found == set.covariates.end()) continue;  // the simulator says what is missing
    std::vector<double>& column = batch->covariates[name];
    for (const int k : block.touches) column.push_back(found->second[observations_.row[k]]);
  }
}

void Predictor::ForBlocks(const std::vector<Block>& blocks,
                          const std::function<void(const Block&)>& body) const {
  const auto run = [&](int begin, int end) {
    for (int b = begin; b < end; ++b) body(blocks[b]);
  };
  const int count = static_cast<int>(blocks.size());
  ParallelFor(count > 1 ? pool_ : nullptr, count, 1, run);
}

absl::StatusOr<Prediction> Predictor::Run(const Model& model, bool details, bool curvature) const {
  const Observations& o = observations_;
  const size_t entries = static_cast<size_t>(o.size()) * o.fingers;
  Prediction p;
  p.fingers = o.fingers;
  p.time_s.assign(entries, NAN);
  if (details) {
    for (auto* column : {&p.travel_m, &p.slope_s_m, &p.cos_incidence}) column->assign(entries, NAN);
    for (auto* column : {&p.previous_press_m, &p.press_m}) column->assign(entries, 0);
    p.contact_m.assign(entries, Eigen::Vector3d::Constant(NAN));
    p.normal.assign(entries, Eigen::Vector3d::Zero());
    p.first_finger.assign(o.size(), -1);
    if (curvature) p.curvature_per_m.assign(entries, NAN);
  }

  Model part = DeterministicPart(model);
  TouchSimulator simulator(std::make_shared<const Model>(part));
  if (curvature && details) {
    // The stage fills curvature only for effects that need it.
    auto asks = std::make_shared<Effect>();
    asks->name = "curvature_of_contacts";
    asks->stage = Stage::kSensor;
    asks->needs.curvature = true;
    asks->apply = [](absl::Span<const double>, TouchBatch&) {};
    part.effects.push_back({asks, false, {}, {}});
    simulator = TouchSimulator(std::make_shared<const Model>(part));
  }
  const bool every_touch = HangsOnSession(part);
  const std::vector<Block>& blocks = every_touch ? touch_blocks_ : pose_blocks_;

  std::mutex mutex;
  absl::Status status;
  std::vector<double> presses;  // only where the next touch feels them
  const auto simulate = [&](const Block& block, TouchBatch* batch, TouchWorkspace* workspace) {
    Fill(block, simulator, batch);
    absl::Status ran = simulator.RunToMotion(batch, workspace);
    if (ran.ok()) return true;
    const std::lock_guard<std::mutex> lock(mutex);
    status = ran;
    return false;
  };
  if (simulator.needs_previous_press() || details) {
    presses.assign(entries, 0);
    ForBlocks(blocks, [&](const Block& block) {
      thread_local TouchBatch batch;
      thread_local TouchWorkspace workspace;
      if (!simulate(block, &batch, &workspace)) return;
      for (size_t t = 0; t < block.touches.size(); ++t)
        for (int i = 0; i < o.fingers; ++i)
          presses[static_cast<size_t>(block.touches[t]) * o.fingers + i] =
              batch.press_m[batch.At(i, static_cast<int>(t))];
    });
    TOUCHSTONE_RETURN_IF_ERROR(status);
    if (!every_touch)
      for (int k = 0; k < o.size(); ++k)
        for (int i = 0; i < o.fingers; ++i)
          presses[static_cast<size_t>(k) * o.fingers + i] =
              presses[static_cast<size_t>(first_of_pose_[o.pose[k]]) * o.fingers + i];
  }

  ForBlocks(blocks, [&](const Block& block) {
    thread_local TouchBatch batch;
    thread_local TouchWorkspace workspace;
    if (!simulate(block, &batch, &workspace)) return;
    for (size_t t = 0; t < block.touches.size() && simulator.needs_previous_press(); ++t) {
      const int previous = o.previous[block.touches[t]];
      for (int i = 0; i < o.fingers && previous >= 0; ++i)
        batch.previous_press_m[batch.At(i, static_cast<int>(t))] =
            presses[static_cast<size_t>(previous) * o.fingers + i];
    }
    if (absl::Status ran = simulator.RunSensor(&batch, &workspace); !ran.ok()) {
      const std::lock_guard<std::mutex> lock(mutex);
      status = ran;
      return;
    }
    for (size_t t = 0; t < block.touches.size(); ++t) {
      const int k = block.touches[t];
      if (details) p.first_finger[k] = batch.first_finger[t];
      for (int i = 0; i < o.fingers; ++i) {
        const size_t to = static_cast<size_t>(k) * o.fingers + i;
        const int from = batch.At(i, static_cast<int>(t));
        p.time_s[to] = batch.reported_time_s[from];
        if (!details) continue;
        p.travel_m[to] = batch.travel_m[from];
        p.slope_s_m[to] = batch.time_per_travel_s_m[from];
        p.cos_incidence[to] = batch.cos_incidence[from];
        p.contact_m[to] = batch.contact_m[from];
        p.normal[to] = batch.normal[from];
        if (curvature) p.curvature_per_m[to] = batch.curvature_per_m[from];
      }
    }
  });
  TOUCHSTONE_RETURN_IF_ERROR(status);

  if (!every_touch) {
    for (int k = 0; k < o.size(); ++k) {
      const int first = first_of_pose_[o.pose[k]];
      if (first == k) continue;
      const size_t to = static_cast<size_t>(k) * o.fingers, from = static_cast<size_t>(first) * o.fingers;
      const auto copy = [&](auto& column) { std::copy_n(&column[from], o.fingers, &column[to]); };
      copy(p.time_s);
      if (!details) continue;
      copy(p.travel_m), copy(p.slope_s_m), copy(p.cos_incidence), copy(p.contact_m), copy(p.normal);
      if (curvature) copy(p.curvature_per_m);
      p.first_finger[k] = p.first_finger[first];
    }
  }
  if (details) {
    p.press_m = presses;
    for (int k = 0; k < o.size(); ++k)
      for (int i = 0; i < o.fingers && o.previous[k] >= 0; ++i)
        p.previous_press_m[static_cast<size_t>(k) * o.fingers + i] =
            presses[static_cast<size_t>(o.previous[k]) * o.fingers + i];
  }
  return p;
}

absl::StatusOr<std::vector<double>> Predictor::TravelWhenMoved(const Model& model, double along_lateral_m,
                                                               double along_binormal_m) const {
  const Observations& o = observations_;
  const TouchSimulator simulator(std::make_shared<const Model>(DeterministicPart(model)));
  std::vector<double> travel_m(static_cast<size_t>(o.size()) * o.fingers, NAN);
  std::mutex mutex;
  absl::Status status;
  ForBlocks(pose_blocks_, [&](const Block& block) {
    thread_local TouchBatch batch;
    thread_local TouchWorkspace workspace;
    Fill(block, simulator, &batch);
    for (int t = 0; t < batch.size(); ++t)
      batch.target_m[t] +=
          along_lateral_m * batch.lateral[t] + along_binormal_m * batch.approach[t].cross(batch.lateral[t]);
    if (absl::Status ran = simulator.RunToMotion(&batch, &workspace); !ran.ok()) {
      const std::lock_guard<std::mutex> lock(mutex);
      status = ran;
      return;
    }
    for (int t = 0; t < batch.size(); ++t)
      for (int i = 0; i < o.fingers; ++i)
        travel_m[static_cast<size_t>(block.touches[t]) * o.fingers + i] = batch.travel_m[batch.At(i, t)];
  });
  TOUCHSTONE_RETURN_IF_ERROR(status);
  for (int k = 0; k < o.size(); ++k)
    std::copy_n(&travel_m[static_cast<size_t>(first_of_pose_[o.pose[k]]) * o.fingers], o.fingers,
                &travel_m[static_cast<size_t>(k) * o.fingers]);
  return travel_m;
}

absl::StatusOr<Prediction> Predict(const Observations& observations, const Model& model, bool details,
                                   bool curvature, ThreadPool* pool) {
  return Predictor(observations, pool).Run(model, details, curvature);
}

std::vector<double> Residuals(const Observations& observations, const Prediction& prediction) {
  const int fingers = observations.fingers;
  std::vector<double> residuals(observations.time_s.size(), NAN);
  for (int k = 0; k < observations.size(); ++k) {
    double sum = 0;
    int count = 0;
    for (size_t e = static_cast<size_t>(k) * fingers; e < static_cast<size_t>(k + 1) * fingers; ++e) {
      residuals[e] = observations.time_s[e] - prediction.time_s[e];
      if (!std::isnan(residuals[e])) sum += residuals[e], ++count;
    }
    for (size_t e = static_cast<size_t>(k) * fingers; e < static_cast<size_t>(k + 1) * fingers; ++e)
      residuals[e] = count >= 2 ? residuals[e] - sum / count : NAN;
  }
  return residuals;
}

SumOfSquares TotalSquares(const Observations& observations, const std::vector<double>& residuals) {
  SumOfSquares total;
  for (int k = 0; k < observations.size(); ++k) {
    if (!observations.used[k]) continue;
    int count = 0;
    for (int i = 0; i < observations.fingers; ++i) {
      const double residual = residuals[static_cast<size_t>(k) * observations.fingers + i];
      if (!std::isnan(residual)) total.sum_of_squares += residual * residual, ++count;
    }
    total.degrees += std::max(count - 1, 0);
  }
  return total;
}

double Rmse(const Observations& observations, const std::vector<double>& residuals) {
  const SumOfSquares total = TotalSquares(observations, residuals);
  return total.degrees > 0 ? std::sqrt(total.sum_of_squares / total.degrees) : 0;
}

}  // namespace touchstone
