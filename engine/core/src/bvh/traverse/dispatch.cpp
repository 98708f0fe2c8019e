#include "bvh/traverse/kernel.h"
#include "simd/isa.h"

namespace glint {

#if defined(GLINT_X86_KERNELS)
const Kernel& best_kernel() {
  const Isa isa = choose_isa(kAvx512);
  return isa == kAvx512 ? kernel_avx512 : isa == kAvx2 ? kernel_avx2 : kernel_sse42;
}
#else
const Kernel& best_kernel() { return kernel_generic; }
#endif

}  // namespace glint
