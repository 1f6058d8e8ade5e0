// The inner loops of the CPU renderer, compiled for several instruction sets and chosen when the program runs. All of
// them do the same single-precision arithmetic in the same order (divisions and square roots are rounded correctly, no
// product is fused with a sum), so that every set gives the same bytes. Part of the CPU renderer only.
//
// Plain numbers and pointers: what is compiled for a newer processor must not share an inline function with the rest of
// the program, since the linker keeps one copy of it.
#pragma once

#include <cstdint>

namespace touchstone::image {

// A projected vertex: pixels, the first pixel's centre at (0.5, 0.5), and the reciprocal of the depth, which is linear
// in them over a triangle. Structure of arrays.
struct ProjectedVertices {
  float* x;
  float* y;
  float* inverse_depth;
};

// pixel = middle + (row of the matrix) . (x, y, z, 1) / depth.
struct ProjectionRows {
  float right[4], down[4], forward[4];
  float middle_x, middle_y;
};

struct DrawnMesh {
  const float* vertices;    // position and normal: six floats each
  const uint32_t* corners;  // three a triangle
  uint32_t vertex_count, triangle_count;
};

// Rows of the pixels' box, `stride` entries each; kernels may write up to kKernelWidth - 1 entries beyond a row's last
// column, where nobody looks.
inline constexpr int kKernelWidth = 16;
struct DrawTarget {
  int first_column, first_row, last_column, last_row;  // one past the last
  int stride;
  float* nearest;      // reciprocal depths; 0 where nothing was drawn
  uint32_t* triangle;  // of the nearest
};

// What shading needs of one image.
struct ShadeConstants {
  float forward[3], right[3], up[3];
  float start[3], start_right[3], start_up[3];
  float key[3], fill[3];  // the lights' positions
  float ambient, key_strength, fill_strength;
  float scale;
  float side_of_back;  // 1, or -1 where faces are also seen from behind
  float start_depth_m;
};

// One row of pixels. Entries without a triangle are left as they are. `grey`, `depth_m` and `mask` may be null.
struct ShadeRow {
  int count;
  const uint32_t* triangle;
  const float* slope_x;  // of each pixel's ray
  float slope_y;
  uint8_t* grey;
  float* depth_m;
  uint8_t* mask;
};

struct CpuKernels {
  const char* name;  // "AVX2", "AVX-512"
  void (*project)(const ProjectionRows& rows, const DrawnMesh& mesh, const ProjectedVertices& projected);
  // `outside_only`: back faces are not drawn. `candidates`: room for one entry per triangle and kKernelWidth more.
  void (*draw)(const DrawnMesh& mesh, const ProjectedVertices& projected, bool outside_only,
               uint32_t* candidates, const DrawTarget& target);
  void (*shade)(const ShadeConstants& constants, const DrawnMesh& mesh, const ShadeRow& row);
};

// What the whole program is compiled for.
const CpuKernels& BaselineKernels();
// Null where this processor, or this build, has no AVX-512.
const CpuKernels* Avx512Kernels();
// The best that this processor has.
const CpuKernels& BestKernels();

}  // namespace touchstone::image
