// Images and encodings on one core: lat20 with about 20,000 triangles, 224 x 224 unless the name says else.
#include <benchmark/benchmark.h>

#include "server/image/encode.h"
#include "tests/bench/scene.h"

namespace touchstone::bench {
namespace {

void RenderImages(benchmark::State& state, absl::StatusOr<std::shared_ptr<Renderer>> renderer, int width,
                  int height, PixelFormat format) {
  if (!renderer.ok()) {
    state.SkipWithError(std::string(renderer.status().message()).c_str());
    return;
  }
  state.SetLabel((*renderer)->description());
  const auto specification = Touches(Lat20(), "");
  const std::vector<TouchPose> poses = AcceptedPoses(*specification, 256);
  ImageOptions options;
  options.width = width;
  options.height = height;
  options.format = format;
  size_t k = 0;
  for (auto _ : state) {
    const TouchPose& pose = poses[k++ % poses.size()];
    const auto image = (*renderer)->Render(
        specification->objects[0], CameraOfTouch(pose.target_m, pose.approach, pose.lateral, pose.standoff_m),
        options);
    if (!image.ok()) state.SkipWithError("render failed");
    benchmark::DoNotOptimize(image->pixels[0]);
  }
  state.SetItemsProcessed(state.iterations());
}

void Cpu224(benchmark::State& state) {
  RenderImages(state, CreateCpuRenderer(), 224, 224, PixelFormat::kGrey);
}
BENCHMARK(Cpu224)->Name("image/cpu/grey_224");
void Cpu224Rgb(benchmark::State& state) {
  RenderImages(state, CreateCpuRenderer(), 224, 224, PixelFormat::kRgb);
}
BENCHMARK(Cpu224Rgb)->Name("image/cpu/rgb_224");
void Cpu640(benchmark::State& state) {
  RenderImages(state, CreateCpuRenderer(), 640, 480, PixelFormat::kGrey);
}
BENCHMARK(Cpu640)->Name("image/cpu/grey_640x480");
void Egl224(benchmark::State& state) {
  RenderImages(state, CreateEglRenderer(-1), 224, 224, PixelFormat::kGrey);
}
BENCHMARK(Egl224)->Name("image/egl/grey_224")->UseRealTime();
void Egl640(benchmark::State& state) {
  RenderImages(state, CreateEglRenderer(-1), 640, 480, PixelFormat::kGrey);
}
BENCHMARK(Egl640)->Name("image/egl/grey_640x480")->UseRealTime();

Image Sample(PixelFormat format) {
  const auto specification = Touches(Lat20(), "");
  const TouchPose pose = AcceptedPoses(*specification, 1)[0];
  ImageOptions options;
  options.format = format;
  return *(*CreateCpuRenderer())
              ->Render(specification->objects[0],
                       CameraOfTouch(pose.target_m, pose.approach, pose.lateral, pose.standoff_m), options);
}

void Png(benchmark::State& state) {
  const Image image = Sample(state.range(0) == 3 ? PixelFormat::kRgb : PixelFormat::kGrey);
  size_t bytes = 0;
  for (auto _ : state)
    bytes = EncodePng(image.pixels.data(), image.width, image.height, image.channels)->size();
  state.counters["bytes"] = bytes;
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(Png)->Name("encode/png_224/channels")->Arg(1)->Arg(3)->Unit(benchmark::kMicrosecond);

void Jpeg(benchmark::State& state) {
  const Image image = Sample(state.range(0) == 3 ? PixelFormat::kRgb : PixelFormat::kGrey);
  size_t bytes = 0;
  for (auto _ : state)
    bytes = EncodeJpeg(image.pixels.data(), image.width, image.height, image.channels, 90)->size();
  state.counters["bytes"] = bytes;
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(Jpeg)->Name("encode/jpeg_224/channels")->Arg(1)->Arg(3)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace touchstone::bench

BENCHMARK_MAIN();
