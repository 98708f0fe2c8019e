#include <cstdlib>
#include <cstring>

#include "kernel.h"

namespace glint {

#if defined(GLINT_X86_KERNELS)
const Kernel& best_kernel() {
  __builtin_cpu_init();
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
  const char* wish = std::getenv("GLINT_ISA");
  return avx2 && !(wish && std::strcmp(wish, "sse42") == 0) ? kernel_avx2 : kernel_sse42;
}
#else
const Kernel& best_kernel() { return kernel_generic; }
#endif

}  // namespace glint
