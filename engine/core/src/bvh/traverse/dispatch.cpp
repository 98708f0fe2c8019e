#include "bvh/traverse/kernel.h"
#include "simd/isa.h"

namespace glint {

#if defined(GLINT_X86_KERNELS)
// Names of those that are compiled (GLINT_KERNELS in CMakeLists.txt).
const Kernel& best_kernel() { return chosen(kernel_for_sse42, kernel_for_avx2, kernel_for_avx512); }
#else
const Kernel& best_kernel() { return kernel_generic; }
#endif

}  // namespace glint
