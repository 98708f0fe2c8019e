#include "bvh/traverse/kernel.h"
#include "simd/isa.h"

namespace glint {

#if defined(GLINT_X86_KERNELS)
const Kernel& best_kernel() { return chosen(kernel_sse42, kernel_avx2, kernel_avx512); }
#else
const Kernel& best_kernel() { return kernel_generic; }
#endif

}  // namespace glint
