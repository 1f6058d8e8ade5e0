// Images and encodings on one core: lat20 with about 20,000 triangles, 224 x 224 unless the name says else.
#include <benchmark/benchmark.h>

#include "server/image/encoding/encode.h"
#include "tests/bench/scene.h"

namespace touchstone::bench {
namespace {

void RenderImages(benchmark::State& state, absl::StatusOr<std::shared_ptr<image::Renderer>> renderer,
                  int width, int height, image::PixelFormat format) {
  if (!renderer.ok()) {
    state.SkipWithError(std::string(renderer.status().message()).c_str());
    return;
  }
  state.SetLabel((*renderer)->description());
  const auto specification = Touches(Lat20(), "");
  const std::vector<touch::TouchPose> poses = AcceptedPoses(*specification, 256);
  image::ImageOptions options;
  options.width = width;
  options.height = height;
  options.format = format;
  size_t k = 0;
  for (auto _ : state) {
    const touch::TouchPose& pose = poses[k++ % poses.size()];
    const auto image = (*renderer)->Render(
        specification->objects[0],
        image::CameraOfTouch(pose.target_m, pose.approach, pose.lateral, pose.standoff_m), options);
    if (!image.ok()) state.SkipWithError("render failed");
    benchmark::DoNotOptimize(image->pixels[0]);
  }
  state.SetItemsProcessed(state.iterations());
}

void Cpu224(benchmark::State& state) {
  RenderImages(state, image::CreateCpuRenderer(), 224, 224, image::PixelFormat::kGrey);
}
BENCHMARK(Cpu224)->Name("image/cpu/grey_224");
void Cpu224Rgb(benchmark::State& state) {
  RenderImages(state, image::CreateCpuRenderer(), 224, 224, image::PixelFormat::kRgb);
}
BENCHMARK(Cpu224Rgb)->Name("image/cpu/rgb_224");
void Cpu640(benchmark::State& state) {
  RenderImages(state, image::CreateCpuRenderer(), 640, 480, image::PixelFormat::kGrey);
}
BENCHMARK(Cpu640)->Name("image/cpu/grey_640x480");
void Egl224(benchmark::State& state) {
  RenderImages(state, image::CreateEglRenderer(-1), 224, 224, image::PixelFormat::kGrey);
}
BENCHMARK(Egl224)->Name("image/egl/grey_224")->UseRealTime();
void Egl640(benchmark::State& state) {
  RenderImages(state, image::CreateEglRenderer(-1), 640, 480, image::PixelFormat::kGrey);
}
BENCHMARK(Egl640)->Name("image/egl/grey_640x480")->UseRealTime();

image::Image Sample(image::PixelFormat format) {
  const auto specification = Touches(Lat20(), "");
  const touch::TouchPose pose = AcceptedPoses(*specification, 1)[0];
  image::ImageOptions options;
  options.format = format;
  return *(*image::CreateCpuRenderer())
              ->Render(specification->objects[0],
                       image::CameraOfTouch(pose.target_m, pose.approach, pose.lateral, pose.standoff_m),
                       options);
}

void Png(benchmark::State& state) {
  const image::Image image =
      Sample(state.range(0) == 3 ? image::PixelFormat::kRgb : image::PixelFormat::kGrey);
  size_t bytes = 0;
  for (auto _ : state)
    bytes = image::EncodePng(image.pixels.data(), image.width, image.height, image.channels)->size();
  state.counters["bytes"] = bytes;
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(Png)->Name("encode/png_224/channels")->Arg(1)->Arg(3)->Unit(benchmark::kMicrosecond);

void Jpeg(benchmark::State& state) {
  const image::Image image =
      Sample(state.range(0) == 3 ? image::PixelFormat::kRgb : image::PixelFormat::kGrey);
  size_t bytes = 0;
  for (auto _ : state)
    bytes = image::EncodeJpeg(image.pixels.data(), image.width, image.height, image.channels, 90)->size();
  state.counters["bytes"] = bytes;
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(Jpeg)->Name("encode/jpeg_224/channels")->Arg(1)->Arg(3)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace touchstone::bench

BENCHMARK_MAIN();
