// The two renderers side by side on the machine at hand: the same pictures of lat20 by EGL and by the CPU, how far
// their grey values lie apart, and pictures per second of both, one picture after another.
//
//   renderer_compare [PICTURES [EGL_DEVICE]]    200 pictures, the first device that renders
#include <absl/strings/numbers.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "server/image/normalize/emulated_photograph.h"
#include "server/image/renderers/renderer.h"
#include "tests/bench/scene.h"

namespace touchstone::bench {
namespace {

constexpr int kWidth = 224;
constexpr int kHeight = 224;
constexpr int kWarmUp = 20;  // pictures before the clock runs: the mesh is prepared, the driver compiles

struct Rendered {
  std::vector<image::Image> pictures;
  double per_second = 0;
};

absl::StatusOr<Rendered> RenderAll(image::Renderer* renderer,
                                   const std::shared_ptr<const geometry::Surface>& surface, int count) {
  image::ImageOptions options;
  options.width = kWidth;
  options.height = kHeight;
  Rendered rendered;
  std::chrono::steady_clock::time_point start;
  for (int k = -kWarmUp; k < count; ++k) {
    if (k == 0) start = std::chrono::steady_clock::now();
    auto picture =
        renderer->Render(surface, image::SpiralView(surface->bounds(), std::max(k, 0), count, 1.0), options);
    if (!picture.ok()) return picture.status();
    if (k >= 0) rendered.pictures.push_back(*std::move(picture));
  }
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  rendered.per_second = count / seconds.count();
  return rendered;
}

void PrintDifferences(const std::vector<image::Image>& egl, const std::vector<image::Image>& cpu) {
  int largest = 0;
  double sum = 0, pixels = 0, differing = 0, beyond_one = 0;
  for (size_t k = 0; k < egl.size(); ++k)
    for (size_t p = 0; p < egl[k].pixels.size(); ++p) {
      const int difference = std::abs(int{egl[k].pixels[p]} - int{cpu[k].pixels[p]});
      largest = std::max(largest, difference);
      sum += difference;
      pixels += 1;
      differing += difference > 0;
      beyond_one += difference > 1;
    }
  std::printf("grey values of %zu pictures, %d x %d: largest difference %d of 255, mean %.5f\n", egl.size(),
              kWidth, kHeight, largest, sum / pixels);
  std::printf("pixels that differ: %.4f %%, by more than 1: %.4f %%\n", 100 * differing / pixels,
              100 * beyond_one / pixels);
}

int Run(int pictures, int device) {
  const auto surface = Lat20();
  const auto egl = image::CreateEglRenderer(device);
  const auto cpu = image::CreateCpuRenderer();
  for (const auto* renderer : {&egl, &cpu})
    if (!renderer->ok()) {
      std::fprintf(stderr, "renderer_compare: %s\n", std::string(renderer->status().message()).c_str());
      return 1;
    }
  Rendered rendered[2];
  for (int which = 0; which < 2; ++which) {
    const auto& renderer = which == 0 ? egl : cpu;
    auto done = RenderAll(renderer->get(), surface, pictures);
    if (!done.ok()) {
      std::fprintf(stderr, "renderer_compare: %s\n", std::string(done.status().message()).c_str());
      return 1;
    }
    rendered[which] = *std::move(done);
    std::printf("%s: %.0f pictures/s (%s)\n", (*renderer)->name().c_str(), rendered[which].per_second,
                (*renderer)->description().c_str());
  }
  std::printf("egl / cpu: %.2f x\n", rendered[0].per_second / rendered[1].per_second);
  PrintDifferences(rendered[0].pictures, rendered[1].pictures);
  return 0;
}

}  // namespace
}  // namespace touchstone::bench

int main(int argc, char** argv) {
  int pictures = 200, device = -1;
  if (argc > 3 || (argc > 1 && (!absl::SimpleAtoi(argv[1], &pictures) || pictures < 1)) ||
      (argc > 2 && !absl::SimpleAtoi(argv[2], &device))) {
    std::fprintf(stderr, "renderer_compare [PICTURES [EGL_DEVICE]]: whole numbers, at least 1 picture\n");
    return 2;
  }
  return touchstone::bench::Run(pictures, device);
}
