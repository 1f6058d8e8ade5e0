// Grey levels and depths of the triangles that are seen, the model of shading.h, row by row.
#include <algorithm>

#include "server/image/renderers/cpu_frame.h"

namespace touchstone::image {
namespace {

void Copy(const Vec3f& from, float* to) {
  to[0] = from.x, to[1] = from.y, to[2] = from.z;
}

ShadeConstants ConstantsOf(const CpuFrame& frame) {
  static_assert(kLights.size() == 2, "the kernels know two lights");
  ShadeConstants constants;
  Copy(frame.forward, constants.forward);
  Copy(frame.right, constants.right);
  Copy(frame.up, constants.up);
  Copy(frame.start, constants.start);
  Copy(frame.start_right, constants.start_right);
  Copy(frame.start_up, constants.start_up);
  std::copy_n(frame.lighting.position_m[0].begin(), 3, constants.key);
  std::copy_n(frame.lighting.position_m[1].begin(), 3, constants.fill);
  constants.ambient = kAmbient;
  constants.key_strength = kLights[0].strength;
  constants.fill_strength = kLights[1].strength;
  constants.scale = frame.lighting.scale;
  constants.side_of_back = frame.outside_only ? 1.0f : -1.0f;
  constants.start_depth_m = static_cast<float>(frame.start_depth_m);
  return constants;
}

}  // namespace

void ShadeVisible(const CpuFrame& frame, const CpuKernels& kernels, Visibility& visibility, Image* image) {
  const PixelBox& box = frame.box;
  const ShadeConstants constants = ConstantsOf(frame);
  const DrawnMesh mesh = DrawnMeshOf(frame);
  const int columns = box.last_column - box.first_column;
  std::vector<uint8_t> levels;  // of a row, before it is written as colours
  if (image->channels == 3) levels.resize(columns);
  for (int row = box.first_row; row < box.last_row; ++row) {
    const size_t first_pixel = static_cast<size_t>(row) * frame.view.width + box.first_column;
    if (image->channels == 3) std::fill(levels.begin(), levels.end(), frame.lighting.background);
    kernels.shade(constants, mesh,
                  {columns, visibility.Row(row), frame.sx.data() + box.first_column, frame.sy[row],
                   image->channels == 3 ? levels.data() : &image->pixels[first_pixel],
                   image->depth_m.empty() ? nullptr : &image->depth_m[first_pixel],
                   image->mask.empty() ? nullptr : &image->mask[first_pixel]});
    for (size_t i = 0; i < levels.size(); ++i)
      std::fill_n(&image->pixels[3 * (first_pixel + i)], 3, levels[i]);
  }
}

}  // namespace touchstone::image
