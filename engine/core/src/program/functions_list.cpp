#include "program/functions_list.h"

#include "simd/isa.h"

namespace glint {

#if defined(GLINT_X86_KERNELS)
const NamedFunction* best_functions() {
  return chosen(functions_sse42, functions_avx2, functions_avx512);
}
#else
const NamedFunction* best_functions() { return functions_generic; }
#endif

}  // namespace glint
