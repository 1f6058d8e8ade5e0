// The simulation of photographs on one core, effect by effect: lat20 with about 20,000 triangles, 224 x 224.
//   photo/anew/NAME  a camera of its own for every picture: rays, light and sensor
//   photo/kept/NAME  one picture again and again while the effect's first value changes, as a fit does: what does not
//                    depend on it is kept
#include <benchmark/benchmark.h>

#include "server/image/photograph/simulate_photo.h"
#include "tests/bench/scene.h"

namespace touchstone::bench {
namespace {

// The effect at its typical values, the first moved by `step` of them; no name: no effect.
std::shared_ptr<const model::Model> TypicalModel(const std::string& name, double step) {
  model::Model model = model::NominalModel();
  if (!name.empty()) {
    model::EffectInstance instance;
    instance.effect = effects::Catalogue().Find(name);
    for (const model::ParameterInfo& p : instance.effect->parameters)
      instance.values.insert(instance.values.end(), p.Count(3), ToSi(p.unit, p.neutral + p.typical));
    const model::ParameterInfo& first = instance.effect->parameters[0];
    instance.values[0] += step * ToSi(first.unit, first.typical);
    model.effects.push_back(instance);
  }
  return std::make_shared<const model::Model>(model);
}

void Simulate(benchmark::State& state, const std::string& name, bool anew) {
  const auto specification = Touches(Lat20(), "");
  const std::vector<touch::TouchPose> poses = AcceptedPoses(*specification, 256);
  const image::PhotoSimulator simulators[] = {image::PhotoSimulator(TypicalModel(name, 0)),
                                              image::PhotoSimulator(TypicalModel(name, 0.01))};
  image::PhotoRequest request;
  request.surface = specification->objects[0];
  request.object = "lat20";
  request.lens = image::PinholeIntrinsics(224, 224, image::Camera().vertical_fov_rad);
  request.lens.cx_px = request.lens.cy_px = 112;
  image::PhotoOutputs outputs;
  outputs.pixels = name == "image_noise";
  image::PhotoWorkspace workspace;
  size_t k = 0;
  for (auto _ : state) {
    const touch::TouchPose& pose = poses[anew ? k % poses.size() : 0];
    request.camera = image::CameraOfTouch(pose.target_m, pose.approach, pose.lateral, pose.standoff_m);
    request.index = k;
    const auto photo = simulators[k++ % 2].Run(request, outputs, &workspace);
    if (!photo.ok()) {
      state.SkipWithError(std::string(photo.status().message()).c_str());
      return;
    }
    benchmark::DoNotOptimize(photo->grey[0]);
  }
  state.SetItemsProcessed(state.iterations());
}

[[maybe_unused]] const bool kRegistered = [] {
  std::vector<std::string> names = {""};
  for (const auto& effect : effects::PhotoEffects()) names.push_back(effect->name);
  names.push_back("object_pose");
  for (const bool anew : {true, false})
    for (const std::string& name : names)
      benchmark::RegisterBenchmark(
          ((anew ? "photo/anew/" : "photo/kept/") + (name.empty() ? std::string("nominal") : name)).c_str(),
          [name, anew](benchmark::State& state) { Simulate(state, name, anew); })
          ->Unit(benchmark::kMicrosecond);
  return true;
}();

}  // namespace
}  // namespace touchstone::bench

BENCHMARK_MAIN();
