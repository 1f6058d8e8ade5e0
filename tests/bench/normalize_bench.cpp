// How well and how fast Normalize parts objects from grounds: a table of emulated photographs (emulated_photograph.h), each
// ground with the same objects and views, none of which the tests use.
//
//   normalize_bench [VIEWS [MESH ...]]    views per object, 20; mesh files, those of meshes/
#include <absl/strings/numbers.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <string>
#include <vector>

#include "server/base/test_paths.h"
#include "server/geometry/files/mesh_file.h"
#include "server/image/normalize/emulated_photograph.h"
#include "server/image/normalize/normalize.h"

namespace touchstone::image {
namespace {

using Surfaces = std::vector<std::shared_ptr<const geometry::Surface>>;

constexpr double kGoodIou = 0.97;

bool ReadSurfaces(const std::vector<std::string>& files, Surfaces* surfaces) {
  for (const std::string& file : files) {
    auto mesh = geometry::ReadMeshFile(file);
    if (mesh.ok()) {
      auto surface = geometry::Surface::Create(file, *std::move(mesh));
      if (surface.ok()) {
        surfaces->push_back(*std::move(surface));
        continue;
      }
      mesh = surface.status();
    }
    std::fprintf(stderr, "%s: %s\n", file.c_str(), std::string(mesh.status().message()).c_str());
    return false;
  }
  return true;
}

bool PrintPlace(Renderer* renderer, const Surfaces& surfaces, int views, const EmulatedPlace& place,
                bool with_background) {
  std::vector<double> ious;
  double seconds = 0;
  for (size_t object = 0; object < surfaces.size(); ++object)
    for (int view = 0; view < views; ++view) {
      const Camera camera =
          SpiralView(surfaces[object]->bounds(), view, views, 1.0 + static_cast<double>(object));
      const EmulatedPhotograph emulated =
          EmulatePhotograph(renderer, surfaces[object], camera, place, 1000 + 100 * object + view);
      const std::clock_t start = std::clock();  // of the processor: other programs do not count
      const auto normalized =
          Normalize(emulated.photograph, with_background ? &emulated.background : nullptr);
      seconds += static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
      if (!normalized.ok()) {
        std::fprintf(stderr, "%s\n", std::string(normalized.status().message()).c_str());
        return false;
      }
      ious.push_back(MaskIou(normalized->mask, emulated.mask));
    }
  std::sort(ious.begin(), ious.end());
  const auto low = std::lower_bound(ious.begin(), ious.end(), kGoodIou) - ious.begin();
  std::printf("| %s%s | %.3f | %.4f | %d of %zu | %.0f |\n", place.name,
              with_background ? ", empty place known" : "", ious.front(), ious[ious.size() / 2],
              static_cast<int>(low), ious.size(), 1e3 * seconds / static_cast<double>(ious.size()));
  std::fflush(stdout);
  return true;
}

int Run(int count, char** words) {
  int views = 20;
  if (count > 1 && (!absl::SimpleAtoi(words[1], &views) || views < 1 || views > 1000)) {
    std::fprintf(stderr, "VIEWS: %s; a number from 1 to 1000 was expected\n", words[1]);
    return 2;
  }
  std::vector<std::string> files(words + std::min(count, 2), words + count);
  if (files.empty())
    for (const char* name : {"lat00", "lat05", "lat10", "lat15", "lat20"})
      files.push_back(SourceDir() + "/meshes/" + name + ".off");
  Surfaces surfaces;
  if (!ReadSurfaces(files, &surfaces)) return 1;
  const auto renderer = CreateCpuRenderer();
  if (!renderer.ok()) return 1;
  std::printf(
      "| ground | worst IoU | median | below %.2f | ms a picture |\n| --- | --- | --- | --- | --- |\n",
      kGoodIou);
  for (const bool with_background : {false, true})
    for (const EmulatedPlace& place : kEmulatedPlaces)
      if (!PrintPlace(renderer->get(), surfaces, views, place, with_background)) return 1;
  return 0;
}

}  // namespace
}  // namespace touchstone::image

int main(int count, char** words) {
  return touchstone::image::Run(count, words);
}
