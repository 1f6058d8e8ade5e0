#include "server/diagnosis/touches/predictor.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <optional>

#include "server/base/status.h"
#include "server/diagnosis/touches/rules.h"
#include "server/effects/contact/surface_departure.h"
#include "server/touch/batch_row.h"

namespace touchstone::diagnosis::touches {
namespace {

// Whether touches of one pose may differ under this model.
bool DependsOnSession(const model::Model& model) {
  return std::any_of(model.effects.begin(), model.effects.end(), [](const model::EffectInstance& instance) {
    const model::EffectNeeds& needs = instance.effect->needs;
    return needs.previous_press || needs.session_time || !needs.covariates.empty();
  });
}

}  // namespace

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
    if (open[object] < 0 || static_cast<int>(blocks[open[object]].touches.size()) == kTouchRules.block) {
      open[object] = static_cast<int>(blocks.size());
      blocks.push_back({object, {}});
    }
    blocks[open[object]].touches.push_back(k);
  }
  return blocks;
}

void Predictor::Fill(const Block& block, const touch::TouchSimulator& simulator,
                     effects::TouchBatch* batch) const {
  const session::MeasurementSet& set = *observations_.set;
  const int size = static_cast<int>(block.touches.size());
  simulator.Prepare(size, batch);
  batch->surface = observations_.surfaces[block.object];
  for (int t = 0; t < size; ++t) {
    const int row = observations_.row[block.touches[t]];
    const touch::TouchPose pose = {set.target_m[row], set.approach[row], set.lateral[row],
                                   set.standoff_m[row]};
    touch::SetTouch(pose, set.speed_m_s[row], set.session_time_s[row], row, t, batch);
    batch->pause_s[t] = PauseS(observations_, block.touches[t]);
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

void Predictor::ForPoses(
    const std::vector<double>& previous_press_m,
    const std::function<void(int, const std::vector<int>&, const FillBatch&)>& body) const {
  ForBlocks(pose_blocks_, [&](const Block& block) {
    body(static_cast<int>(&block - pose_blocks_.data()), block.touches,
         [&](const touch::TouchSimulator& simulator, effects::TouchBatch* batch) {
           Fill(block, simulator, batch);
           for (size_t t = 0; t < block.touches.size(); ++t)
             for (int i = 0; i < observations_.fingers; ++i)
               batch->previous_press_m[batch->At(i, static_cast<int>(t))] =
                   previous_press_m[static_cast<size_t>(block.touches[t]) * observations_.fingers + i];
         });
  });
}

// One prediction under way: simulation block by block, then copies for the repeats of a pose.
class Predictor::Task {
 public:
  // `noise_seed`: of the random effects; nothing: there are none.
  Task(const Predictor& predictor, const model::Model& model, bool details, bool curvature,
       std::optional<uint64_t> noise_seed = {})
      : predictor_(predictor),
        o_(predictor.observations_),
        details_(details),
        curvature_(curvature && details),
        noise_seed_(noise_seed),
        model_(noise_seed ? model : DeterministicPart(model)),
        every_touch_(noise_seed || DependsOnSession(model_)),
        simulator_(std::make_shared<const model::Model>(WithCurvature())),
        blocks_(every_touch_ ? predictor.touch_blocks_ : predictor.pose_blocks_) {}

  absl::StatusOr<Prediction> Run() {
    Allocate();
    if (simulator_.needs_previous_press() || details_) {
      FindPresses();
      TOUCHSTONE_RETURN_IF_ERROR(status_);
    }
    predictor_.ForBlocks(blocks_, [this](const Block& block) { Simulate(block); });
    TOUCHSTONE_RETURN_IF_ERROR(status_);
    if (!every_touch_) CopyToRepeats();
    if (details_) FillPresses();
    return std::move(p_);
  }

 private:
  // The contact stage fills curvature only for effects that need it.
  model::Model WithCurvature() const {
    model::Model model = model_;
    if (!curvature_) return model;
    auto asks = std::make_shared<model::Effect>();
    asks->name = "curvature_of_contacts";
    asks->stage = model::Stage::kSensor;
    asks->needs.curvature = true;
    asks->apply = [](absl::Span<const double>, effects::TouchBatch&) {};
    model.effects.push_back({asks, false, {}, {}});
    return model;
  }

  void Allocate() {
    const size_t entries = static_cast<size_t>(o_.size()) * o_.fingers;
    p_.fingers = o_.fingers;
    p_.time_s.assign(entries, NAN);
    if (!details_) return;
    for (auto* column : {&p_.travel_m, &p_.inverse_speed_s_per_m, &p_.cos_incidence})
      column->assign(entries, NAN);
    for (auto* column : {&p_.previous_press_m, &p_.press_m}) column->assign(entries, 0);
    p_.contact_m.assign(entries, Eigen::Vector3d::Constant(NAN));
    p_.contact_in_mesh_m = p_.contact_m;
    p_.normal.assign(entries, Eigen::Vector3d::Zero());
    p_.first_finger.assign(o_.size(), -1);
    if (curvature_) p_.curvature_per_m.assign(entries, NAN);
  }

  size_t Entry(int k, int finger) const { return static_cast<size_t>(k) * o_.fingers + finger; }

  void Fail(absl::Status status) {
    const std::lock_guard<std::mutex> lock(mutex_);
    status_ = std::move(status);
  }

  void Fill(const Block& block, effects::TouchBatch* batch) const {
    predictor_.Fill(block, simulator_, batch);
    batch->seed = noise_seed_.value_or(0);
  }

  bool SimulateToMotion(effects::TouchBatch* batch, touch::TouchWorkspace* workspace) {
    absl::Status ran = simulator_.RunToMotion(batch, workspace);
    if (!ran.ok()) Fail(ran);
    return ran.ok();
  }

  // How far each touch presses each finger, which the next touch may feel.
  void FindPresses() {
    presses_m_.assign(static_cast<size_t>(o_.size()) * o_.fingers, 0);
    predictor_.ForBlocks(blocks_, [this](const Block& block) {
      thread_local effects::TouchBatch batch;
      thread_local touch::TouchWorkspace workspace;
      Fill(block, &batch);
      if (!SimulateToMotion(&batch, &workspace)) return;
      for (size_t t = 0; t < block.touches.size(); ++t)
        for (int i = 0; i < o_.fingers; ++i)
          presses_m_[Entry(block.touches[t], i)] = batch.press_m[batch.At(i, static_cast<int>(t))];
    });
    if (every_touch_) return;
    for (int k = 0; k < o_.size(); ++k)
      for (int i = 0; i < o_.fingers; ++i)
        presses_m_[Entry(k, i)] = presses_m_[Entry(predictor_.first_of_pose_[o_.pose[k]], i)];
  }

  void Simulate(const Block& block) {
    thread_local effects::TouchBatch batch;
    thread_local touch::TouchWorkspace workspace;
    Fill(block, &batch);
    for (size_t t = 0; t < block.touches.size() && simulator_.needs_previous_press(); ++t) {
      const int previous = o_.previous[block.touches[t]];
      for (int i = 0; i < o_.fingers && previous >= 0; ++i)
        batch.previous_press_m[batch.At(i, static_cast<int>(t))] = presses_m_[Entry(previous, i)];
    }
    if (!SimulateToMotion(&batch, &workspace)) return;
    if (absl::Status ran = simulator_.RunSensor(&batch, &workspace); !ran.ok()) return Fail(std::move(ran));
    for (size_t t = 0; t < block.touches.size(); ++t) Keep(batch, static_cast<int>(t), block.touches[t]);
  }

  // Touch t of a batch is touch k.
  void Keep(const effects::TouchBatch& batch, int t, int k) {
    if (details_) p_.first_finger[k] = batch.first_finger[t];
    for (int i = 0; i < o_.fingers; ++i) {
      const size_t to = Entry(k, i);
      const int from = batch.At(i, t);
      p_.time_s[to] = batch.reported_time_s[from];
      if (!details_) continue;
      p_.travel_m[to] = batch.travel_m[from];
      p_.inverse_speed_s_per_m[to] = batch.time_per_travel_s_m[from];
      p_.cos_incidence[to] = batch.cos_incidence[from];
      p_.contact_m[to] = batch.contact_m[from];
      p_.contact_in_mesh_m[to] = effects::ContactInMesh(batch, from);
      p_.normal[to] = batch.normal[from];
      if (curvature_) p_.curvature_per_m[to] = batch.curvature_per_m[from];
    }
  }

  void CopyToRepeats() {
    for (int k = 0; k < o_.size(); ++k) {
      const int first = predictor_.first_of_pose_[o_.pose[k]];
      if (first == k) continue;
      const size_t to = Entry(k, 0), from = Entry(first, 0);
      const auto copy = [&](auto& column) { std::copy_n(&column[from], o_.fingers, &column[to]); };
      copy(p_.time_s);
      if (!details_) continue;
      copy(p_.travel_m), copy(p_.inverse_speed_s_per_m), copy(p_.cos_incidence), copy(p_.contact_m),
          copy(p_.contact_in_mesh_m), copy(p_.normal);
      if (curvature_) copy(p_.curvature_per_m);
      p_.first_finger[k] = p_.first_finger[first];
    }
  }

  void FillPresses() {
    p_.press_m = presses_m_;
    for (int k = 0; k < o_.size(); ++k)
      for (int i = 0; i < o_.fingers && o_.previous[k] >= 0; ++i)
        p_.previous_press_m[Entry(k, i)] = presses_m_[Entry(o_.previous[k], i)];
  }

  const Predictor& predictor_;
  const Observations& o_;
  const bool details_, curvature_;
  const std::optional<uint64_t> noise_seed_;
  const model::Model model_;
  const bool every_touch_;  // else one touch per pose
  const touch::TouchSimulator simulator_;
  const std::vector<Block>& blocks_;
  Prediction p_;
  std::vector<double> presses_m_;  // empty unless they are needed
  std::mutex mutex_;
  absl::Status status_;
};

absl::StatusOr<Prediction> Predictor::Run(const model::Model& model, bool details, bool curvature) const {
  return Task(*this, model, details, curvature).Run();
}

absl::StatusOr<std::vector<double>> Predictor::Draw(const model::Model& model, uint64_t seed) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(Prediction drawn, Task(*this, model, false, false, seed).Run());
  return std::move(drawn.time_s);
}

absl::StatusOr<std::vector<double>> Predictor::TravelWhenMoved(const model::Model& model,
                                                               double along_lateral_m,
                                                               double along_binormal_m) const {
  const Observations& o = observations_;
  const touch::TouchSimulator simulator(std::make_shared<const model::Model>(DeterministicPart(model)));
  std::vector<double> travel_m(static_cast<size_t>(o.size()) * o.fingers, NAN);
  std::mutex mutex;
  absl::Status status;
  ForBlocks(pose_blocks_, [&](const Block& block) {
    thread_local effects::TouchBatch batch;
    thread_local touch::TouchWorkspace workspace;
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

absl::StatusOr<Prediction> Predict(const Observations& observations, const model::Model& model, bool details,
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
    total.degrees_of_freedom += std::max(count - 1, 0);
  }
  return total;
}

double Rmse(const Observations& observations, const std::vector<double>& residuals) {
  const SumOfSquares total = TotalSquares(observations, residuals);
  return total.degrees_of_freedom > 0 ? std::sqrt(total.sum_of_squares / total.degrees_of_freedom) : 0;
}

}  // namespace touchstone::diagnosis::touches
