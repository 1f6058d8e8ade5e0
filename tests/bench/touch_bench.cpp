// Touches in the process, on one core, and what they are compared with. Items are touches of three fingers.
#include <benchmark/benchmark.h>
#include <embree3/rtcore.h>

#include "server/base/units.h"
#include "tests/bench/brute_force.h"
#include "tests/bench/scene.h"

namespace touchstone::bench {
namespace {

constexpr uint32_t kBatch = 4096;

// Poses, casting, effects, noise and output of whole chunks, as the stream's tasks make them.
void MakeChunks(benchmark::State& state, const std::string& effects, uint64_t triangles, uint32_t batches,
                double step_angle_deg = 1) {
  const auto specification = Touches(Lat20(triangles), effects);
  specification->plan.sphere.step_angle_rad = step_angle_deg * kPi / 180;
  const dataset::BatchMaker maker(specification);
  dataset::TouchSampler::Workspace workspace;
  const std::atomic<bool> cancelled{false};
  uint64_t index = 0;
  const auto make_chunk = [&](uint32_t count) {
    std::vector<dataset::DatasetBatch> chunk(count);
    for (dataset::DatasetBatch& batch : chunk) {
      batch.start_index = index;
      batch.rows = kBatch;
      index += kBatch;
    }
    if (!maker.Make(absl::MakeSpan(chunk), cancelled, &workspace).ok()) state.SkipWithError("failed");
    benchmark::DoNotOptimize(chunk[0].data[1][0]);
  };
  make_chunk(64);  // what a surface prepares at its first contacts is not part of a touch's price
  for (auto _ : state) make_chunk(batches);
  state.SetItemsProcessed(state.iterations() * batches * kBatch);
}

void Touches20k(benchmark::State& state) {
  MakeChunks(state, kNoise, kTriangles, state.range(0));
}
BENCHMARK(Touches20k)
    ->Name("touches/chunk_batches")
    ->Arg(1)
    ->Arg(2)
    ->Arg(8)
    ->Arg(16)
    ->Arg(32)
    ->Arg(64)
    ->Arg(128)
    ->Unit(benchmark::kMillisecond);

// Steps so fine that no pose comes twice: what the default plan's 65,160 poses, cast once a chunk, save.
void TouchesWithoutRepeats(benchmark::State& state) {
  MakeChunks(state, kNoise, kTriangles, state.range(0), 0.01);
}
BENCHMARK(TouchesWithoutRepeats)
    ->Name("touches/without_repeats")
    ->Arg(32)
    ->Arg(64)
    ->Arg(128)
    ->Unit(benchmark::kMillisecond);

void TouchesByTriangles(benchmark::State& state) {
  MakeChunks(state, kNoise, state.range(0), 128);
}
BENCHMARK(TouchesByTriangles)
    ->Name("touches/triangles")
    ->Arg(2000)
    ->Arg(20000)
    ->Arg(200000)
    ->Arg(2000000)
    ->Unit(benchmark::kMillisecond);

void TouchesIdeal(benchmark::State& state) {
  MakeChunks(state, "", kTriangles, 64);
}
BENCHMARK(TouchesIdeal)->Name("touches/ideal_model")->Unit(benchmark::kMillisecond);
void TouchesFiveEffects(benchmark::State& state) {
  MakeChunks(state, kFiveEffects, kTriangles, 64);
}
BENCHMARK(TouchesFiveEffects)->Name("touches/five_effects")->Unit(benchmark::kMillisecond);
void TouchesTipRadius(benchmark::State& state) {
  MakeChunks(state, kTipRadius, kTriangles, 64);
}
BENCHMARK(TouchesTipRadius)->Name("touches/tip_radius")->Unit(benchmark::kMillisecond);

// The plain loop: three rtcIntersect1 per touch, samples in their order, distances only.
void Intersect1(benchmark::State& state) {
  const auto specification = Touches(Lat20(state.range(0)), "");
  const std::vector<touch::TouchPose> poses = AcceptedPoses(*specification, 1 << 16);
  const auto scene = static_cast<RTCScene>(specification->objects[0]->embree_scene());
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  float sum = 0;
  for (auto _ : state) {
    for (const touch::TouchPose& pose : poses) {
      for (int finger = -1; finger <= 1; ++finger) {
        const Eigen::Vector3f origin =
            (pose.target_m - pose.approach * pose.standoff_m + pose.lateral * (0.03 * finger)).cast<float>();
        RTCRayHit ray;
        ray.ray.org_x = origin.x(), ray.ray.org_y = origin.y(), ray.ray.org_z = origin.z();
        ray.ray.dir_x = pose.approach.x(), ray.ray.dir_y = pose.approach.y(),
        ray.ray.dir_z = pose.approach.z();
        ray.ray.tnear = 0, ray.ray.tfar = 10, ray.ray.time = 0;
        ray.ray.mask = -1, ray.ray.flags = 0;
        ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(scene, &context, &ray);
        sum += ray.ray.tfar;
      }
    }
  }
  benchmark::DoNotOptimize(sum);
  state.SetItemsProcessed(state.iterations() * poses.size());
}
BENCHMARK(Intersect1)
    ->Name("baseline/rtcIntersect1")
    ->Arg(2000)
    ->Arg(20000)
    ->Arg(200000)
    ->Arg(2000000)
    ->Unit(benchmark::kMillisecond);

// The baseline: Ericson's segment against every triangle, single precision.
void BruteForce(benchmark::State& state) {
  const auto specification = Touches(Lat20(), "");
  const std::vector<touch::TouchPose> poses = AcceptedPoses(*specification, 64);
  const geometry::TriangleMesh& mesh = specification->objects[0]->mesh();
  float sum = 0;
  for (auto _ : state)
    for (const touch::TouchPose& pose : poses)
      for (int finger = -1; finger <= 1; ++finger)
        sum += BruteForceTravel(
            mesh, pose.target_m - pose.approach * pose.standoff_m + pose.lateral * (0.03 * finger),
            pose.approach, 1.0f);
  benchmark::DoNotOptimize(sum);
  state.SetItemsProcessed(state.iterations() * poses.size());
}
BENCHMARK(BruteForce)->Name("baseline/brute_force")->Unit(benchmark::kMillisecond);

// Building what a touch needs of a mesh (all cores), and what it holds.
void BuildSurface(benchmark::State& state) {
  const geometry::TriangleMesh mesh =
      *geometry::MakeSupershape(*geometry::NamedSupershape("lat20"), state.range(0));
  double bytes_per_triangle = 0;
  for (auto _ : state) {
    const auto surface = *geometry::Surface::Create("lat20", mesh);
    bytes_per_triangle = static_cast<double>(surface->MemoryBytes()) / surface->mesh().triangles.size();
  }
  state.counters["bytes_per_triangle"] = bytes_per_triangle;
}
BENCHMARK(BuildSurface)
    ->Name("build/surface")
    ->Arg(20000)
    ->Arg(200000)
    ->Arg(2000000)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
}  // namespace touchstone::bench

BENCHMARK_MAIN();
