// The kernels for processors with AVX-512 (F, BW, DQ, VL), whatever the rest of the program is compiled for.
#ifdef __AVX512F__
#include "server/image/renderers/cpu_kernels_template.h"
#else
#include "server/image/renderers/cpu_kernels.h"
#endif

namespace touchstone::image {

const CpuKernels* Avx512Kernels() {
#ifdef __AVX512F__
  static constexpr CpuKernels kKernels = {"AVX-512", &Project, &Draw, &Shade};
  const bool there = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                     __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
  return there ? &kKernels : nullptr;
#else
  return nullptr;
#endif
}

}  // namespace touchstone::image
