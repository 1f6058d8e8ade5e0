// What the benchmarks share: the reference object (lat20 with about 20,000 triangles), datasets, and
// baselines.
#pragma once

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "server/dataset/stream.h"
#include "server/effects/all_effects.h"
#include "server/geometry/shapes/supershape.h"

namespace touchstone::bench {

inline constexpr uint64_t kTriangles = 20000;

inline std::shared_ptr<const geometry::Surface> Lat20(uint64_t triangles = kTriangles) {
  return *geometry::Surface::Create(
      "lat20", *geometry::MakeSupershape(*geometry::NamedSupershape("lat20"), triangles));
}

inline std::shared_ptr<const model::Model> ModelWith(const std::string& effects) {
  return std::make_shared<const model::Model>(
      *model::ParseModel("touchstone: model/1\nname: bench\nend_effector: {fingers: 3, spacing_mm: 30}\n" +
                             (effects.empty() ? std::string() : "effects:\n" + effects),
                         "bench", effects::Catalogue()));
}

// The nominal model of the measurement sets: noise on every finger.
inline const char kNoise[] = "  - gaussian_noise: {sigma_us: 5000}\n";
// The five commonest effects on top of it.
inline const char kFiveEffects[] =
    "  - gaussian_noise: {sigma_us: 5000}\n"
    "  - finger_length: {offset_mm: [0.1, -0.15, 0.05]}\n"
    "  - tool_tilt: {angle_deg: 0.5}\n"
    "  - oblique_slip: {travel_mm: 0.5}\n"
    "  - object_push: {shift_mm: 0.3}\n"
    "  - speed_error: {relative: 0.01}\n";
inline const char kTipRadius[] = "  - gaussian_noise: {sigma_us: 5000}\n  - tip_radius: {radius_mm: 1.5}\n";

inline std::shared_ptr<dataset::DatasetSpecification> Touches(
    std::shared_ptr<const geometry::Surface> surface, const std::string& effects) {
  auto specification = std::make_shared<dataset::DatasetSpecification>();
  specification->objects = {std::move(surface)};
  specification->model = ModelWith(effects);
  specification->seed = 1;
  specification->samples = uint64_t{1} << 40;
  specification->columns = *dataset::ColumnChoice::FromNames({});
  if (!dataset::ValidateDataset(specification.get()).ok()) std::abort();
  return specification;
}

// Accepted poses of a dataset, in the order of the samples: what baselines cast.
inline std::vector<touch::TouchPose> AcceptedPoses(const dataset::DatasetSpecification& specification,
                                                   size_t count) {
  std::vector<uint64_t> indices(count);
  for (size_t k = 0; k < count; ++k) indices[k] = k;
  std::vector<touch::TouchPose> poses(count);
  dataset::TouchSampler::Workspace workspace;
  const std::atomic<bool> cancelled{false};
  const auto status =
      dataset::TouchSampler(specification)
          .Sample(indices, cancelled, &workspace, [&](const dataset::TouchSampler::Block& block) {
            for (int t = 0; t < block.batch.size(); ++t)
              if (block.accepted[t]) poses[block.slots[t]] = block.Pose(t);
          });
  if (!status.ok()) std::abort();
  return poses;
}

}  // namespace touchstone::bench
