// The kernels for what the whole program is compiled for, and the choice among them.
#include "server/image/renderers/cpu_kernels_template.h"

namespace touchstone::image {

const CpuKernels& BaselineKernels() {
#ifdef __AVX2__
  static constexpr CpuKernels kKernels = {"AVX2", &Project, &Draw, &Shade};
#else
  static constexpr CpuKernels kKernels = {"vectors of 8", &Project, &Draw, &Shade};
#endif
  return kKernels;
}

const CpuKernels& BestKernels() {
  const CpuKernels* const avx512 = Avx512Kernels();
  return avx512 != nullptr ? *avx512 : BaselineKernels();
}

}  // namespace touchstone::image
