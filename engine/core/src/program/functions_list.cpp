#include "program/functions_list.h"

#include "simd/isa.h"

namespace glint {

#if defined(GLINT_X86_KERNELS)
const NamedFunction* best_functions() {
  const Isa isa = choose_isa(kAvx512);
  return isa == kAvx512 ? functions_avx512 : isa == kAvx2 ? functions_avx2 : functions_sse42;
}
#else
const NamedFunction* best_functions() { return functions_generic; }
#endif

}  // namespace glint
